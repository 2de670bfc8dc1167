//! Compiled inference blocks: typed steps, whose kernels are found, whose selections are
//! read, and whose expressions are functions of the program.

use super::code::{BlockId, Operand};
use super::key::Key;
use super::value::Value;
use pcadlang_syntax::ast::{self, BinaryOp, Expr, ExprKind, Name};
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// An inference block, with all that it needs of its program.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Its name, if it has one.
    pub name: Option<Arc<str>>,
    /// Its statements.
    pub steps: Box<[Step]>,
    /// The kernels that the program declares.
    pub kernels: Arc<[DeclaredKernel]>,
    /// The choices that the program freezes.
    pub freezes: Arc<[Selection]>,
}

impl Plan {
    /// The columns that its `collect` statements name, each once; `None` if it has no such
    /// statement.
    pub fn collected(&self) -> Option<Vec<(String, Operand)>> {
        fn gather(steps: &[Step], all: &mut Option<Vec<(String, Operand)>>) {
            for step in steps {
                if let StepKind::Collect(columns) = &step.kind {
                    let all = all.get_or_insert_default();
                    let new = columns.iter().filter(|(n, _)| !all.iter().any(|(m, _)| m == n));
                    let new: Vec<_> = new.cloned().collect();
                    all.extend(new);
                }
                gather(step.body(), all);
            }
        }
        let mut all = None;
        gather(&self.steps, &mut all);
        all
    }
}

/// A kernel that the program declares.
#[derive(Clone, Debug)]
pub struct DeclaredKernel {
    /// Its name.
    pub name: Name,
    /// Its parameters, each with its default. They are its first variables.
    pub params: Box<[(Arc<str>, Option<Formula>)]>,
    /// Its statements.
    pub steps: Box<[Step]>,
    /// True if it proposes values itself, instead of applying other kernels.
    pub proposes: bool,
    /// True if it contains a map.
    pub maps: bool,
}

/// A statement of an inference block or a declared kernel.
#[derive(Clone, Debug)]
pub struct Step {
    /// Its action.
    pub kind: StepKind,
    /// The whole statement.
    pub span: Span,
}

/// The kinds of statements.
#[derive(Clone, Debug)]
pub enum StepKind {
    /// `init(…)`: only the first one of a block counts, before the block runs.
    Init(Init),
    /// `anneal(from)`
    Anneal(Formula),
    /// `warmup n { … }`
    Warmup(Formula, Box<[Step]>),
    /// `repeat n { … }`
    Repeat(Formula, Box<[Step]>),
    /// `every n { … }`
    Every(Formula, Box<[Step]>),
    /// `for x in e { … }`: the items, the variable, the body.
    For(Formula, Variable, Box<[Step]>),
    /// `mix { w => kernel; … }`
    Mix(Box<[(Formula, Step)]>),
    /// `stop when e`
    StopWhen(Formula),
    /// `collect e, …`: the name of each column, and an operand of the top level.
    Collect(Box<[(String, Operand)]>),
    /// `let x = e`
    Let(Variable, Formula),
    /// `propose @x ~ d`
    Propose(Path, Formula),
    /// `propose u ~ d`, an auxiliary variable.
    Draw(Name, Variable, Formula),
    /// `propose @x = e`
    Map(Path, Formula),
    /// `propose u = e`
    MapDrawn(Name, Formula),
    /// A kernel.
    Apply(KernelCall),
}

impl Step {
    /// The statements inside of it.
    pub fn body(&self) -> &[Step] {
        match &self.kind {
            StepKind::Warmup(_, body)
            | StepKind::Repeat(_, body)
            | StepKind::Every(_, body)
            | StepKind::For(_, _, body) => body,
            _ => &[],
        }
    }

    /// The kernels that it applies itself.
    pub fn calls(&self) -> impl Iterator<Item = &KernelCall> {
        let (one, arms) = match &self.kind {
            StepKind::Mix(arms) => (None, &arms[..]),
            _ => (Some(self), &[][..]),
        };
        one.into_iter().chain(arms.iter().map(|(_, step)| step)).filter_map(|s| match &s.kind {
            StepKind::Apply(call) => Some(call),
            _ => None,
        })
    }

    /// True if it, or a statement inside of it, is such a one.
    pub fn any(&self, is: &impl Fn(&StepKind) -> bool) -> bool {
        is(&self.kind) || self.body().iter().any(|s| s.any(is))
    }
}

/// How a chain starts.
#[derive(Clone, Debug)]
pub enum Init {
    /// `prior(n)`, with the number of draws if it is given.
    Prior(Option<Formula>),
    /// `unconstrained(n)`, with the number of restarts if it is given.
    Unconstrained(Option<Formula>),
    /// `best_of(n, keep, from)`
    BestOf(BestOf),
}

/// `best_of(n, keep, from)`: how a chain starts.
#[derive(Clone, Debug)]
pub struct BestOf {
    /// The number of draws.
    pub draws: Formula,
    /// How many are kept.
    pub keep: Option<Formula>,
    /// The kernel that moves them.
    pub from: Option<KernelCall>,
}

/// A call of a kernel.
#[derive(Clone, Debug)]
pub struct KernelCall {
    /// Its index among all calls of the program's blocks and kernels.
    pub index: usize,
    /// The call as written.
    pub text: Arc<str>,
    /// Its position.
    pub span: Span,
    /// The kernel.
    pub kernel: Callee,
    /// One argument per parameter of the kernel.
    pub args: Box<[Argument]>,
    /// True if it means the same whenever it is applied.
    pub is_constant: bool,
}

/// The kernel of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Callee {
    /// A built-in, by its index in the table.
    Builtin(u32),
    /// A kernel of the program, by its index in [`Plan::kernels`].
    Declared(usize),
}

/// An argument of a kernel.
#[derive(Clone, Debug)]
pub enum Argument {
    /// It was left out.
    Omitted,
    /// A value.
    Value(Formula),
    /// The choices it moves, or some of them.
    Choices(Choices),
    /// Another kernel.
    Kernel(KernelCall),
}

/// Which of the selected choices a step moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pick {
    /// All of them.
    #[default]
    All,
    /// One of them, chosen uniformly at random (`one(sel)`).
    One,
    /// Each in turn, in the order of the program (`each(sel)`): a sweep of as many steps.
    /// Moves that would change the members of the selection are rejected, so that the
    /// order does not depend on the outcomes of the steps.
    Each,
}

/// A selection, and which of its choices a kernel moves at a time.
#[derive(Clone, Debug)]
pub struct Choices {
    /// Which of them.
    pub pick: Pick,
    /// The selection.
    pub selection: Selection,
}

/// A selection of choices.
#[derive(Clone, Debug)]
pub enum Selection {
    /// Choices at or below an address.
    Path(Path),
    /// Choices with a tag, and its value if given.
    Tag(Arc<str>, Option<Arc<str>>),
    /// `a + b`
    Union(Box<Selection>, Box<Selection>),
    /// `a & b`
    Both(Box<Selection>, Box<Selection>),
    /// `a - b`
    Minus(Box<Selection>, Box<Selection>),
}

/// An address with wildcards and computed keys.
#[derive(Clone, Debug)]
pub struct Path {
    /// Its segments.
    pub segments: Box<[PathSegment]>,
    /// Its position.
    pub span: Span,
}

/// A segment of a path.
#[derive(Clone, Debug)]
pub enum PathSegment {
    /// `**`
    Deep,
    /// A name (`None` for `*`) with its occurrence and keys.
    Named(Option<Arc<str>>, u32, Box<[PathKey]>),
}

/// A key of a segment.
#[derive(Clone, Debug)]
pub enum PathKey {
    /// `[*]`
    Any,
    /// A key as written.
    Fixed(Key),
    /// `[{e}]`
    Computed(Formula),
}

impl Selection {
    /// Reads a selection; `key` reads computed keys.
    ///
    /// # Errors
    /// The part of the expression that is not a selection.
    pub fn read(e: &Expr, key: &mut dyn FnMut(&Expr) -> Formula) -> Result<Selection, Span> {
        match &e.kind {
            ExprKind::Address(a) => Ok(Selection::Path(Path::read(a, e.span, key))),
            ExprKind::TagSel { name, value } => Ok(Selection::Tag(name.clone(), value.clone())),
            ExprKind::Binary { op, left, right } => {
                let join = match op {
                    BinaryOp::Add => Selection::Union,
                    BinaryOp::Sub => Selection::Minus,
                    BinaryOp::Intersect => Selection::Both,
                    _ => return Err(e.span),
                };
                let left = Box::new(Selection::read(left, key)?);
                Ok(join(left, Box::new(Selection::read(right, key)?)))
            }
            _ => Err(e.span),
        }
    }
}

impl Path {
    /// Reads an address; `key` reads computed keys.
    pub fn read(a: &ast::Address, span: Span, key: &mut dyn FnMut(&Expr) -> Formula) -> Path {
        let mut read = |k: &ast::Key| match k {
            ast::Key::Str(s) => PathKey::Fixed(Key::Str(Arc::clone(s))),
            ast::Key::Num(x) => Key::num(*x).map_or(PathKey::Any, PathKey::Fixed),
            ast::Key::Any => PathKey::Any,
            ast::Key::Expr(e) => PathKey::Computed(key(e)),
        };
        let mut segment = |s: &ast::Segment| {
            let name = match &s.name {
                ast::SegmentName::Deep => return PathSegment::Deep,
                ast::SegmentName::Any => None,
                ast::SegmentName::Name(name) => Some(Arc::clone(name)),
            };
            PathSegment::Named(name, s.occurrence, s.keys.iter().map(&mut read).collect())
        };
        Path { segments: a.segments.iter().map(&mut segment).collect(), span }
    }
}

/// A variable of a block or declared kernel: its index among those that are visible where
/// it is bound, outermost first.
pub type Variable = usize;

/// An expression of a plan.
#[derive(Clone, Debug)]
pub struct Formula {
    /// Its value.
    pub kind: FormulaKind,
    /// Its position.
    pub span: Span,
}

/// The forms of expressions.
#[derive(Clone, Debug)]
pub enum FormulaKind {
    /// A constant.
    Const(Value),
    /// A value that the plan supplies.
    Given(Given),
    /// A function of the program, applied to values that the plan supplies.
    Function {
        /// The function.
        block: BlockId,
        /// Its arguments.
        given: Box<[Given]>,
        /// True if it reads nothing else of the state.
        is_closed: bool,
        /// True if what else it reads depends on no choice.
        is_settled: bool,
    },
}

/// A value that a plan supplies to its expressions.
#[derive(Clone, Debug)]
pub enum Given {
    /// A variable.
    Variable(Variable),
    /// `value(@x)`: the present value of a choice.
    Choice(Path),
    /// `steps()`
    Steps,
    /// `elapsed()`
    Elapsed,
    /// A built-in that is undefined here.
    Unavailable(Arc<str>, Span),
}

impl Formula {
    /// A constant.
    pub fn constant(value: Value, span: Span) -> Formula {
        Formula { kind: FormulaKind::Const(value), span }
    }

    /// True if its value is always the same.
    pub fn is_constant(&self) -> bool {
        match &self.kind {
            FormulaKind::Const(_) => true,
            FormulaKind::Given(_) => false,
            FormulaKind::Function { given, is_closed, is_settled, .. } => {
                given.is_empty() && (*is_closed || *is_settled)
            }
        }
    }
}
