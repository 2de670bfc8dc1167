//! Small programs as trees, and their text.

use std::fmt::{self, Display, Formatter, Write};

/// A name, as an index into [`Program::names`].
pub type Id = usize;

/// An expression; it does not contain draws.
#[derive(Clone, Debug)]
pub enum Expr {
    Num(f64),
    Truth(bool),
    Ref(Id),
    /// The variable of the enclosing loop.
    Pass,
    /// An element of a container of choices.
    Element(Id, Box<Expr>),
    Add(Box<Expr>, Box<Expr>),
    Mul(Box<Expr>, Box<Expr>),
    Equal(Box<Expr>, Box<Expr>),
    Less(Box<Expr>, Box<Expr>),
    And(Box<Expr>, Box<Expr>),
    Or(Box<Expr>, Box<Expr>),
    Not(Box<Expr>),
    If(Box<Expr>, Box<Expr>, Box<Expr>),
    /// An element of a literal array.
    Table(Vec<Expr>, Box<Expr>),
}

/// A distribution.
#[derive(Clone, Debug)]
pub enum Dist {
    Flip(Expr),
    Categorical(Vec<Expr>),
    /// Uniform over the whole numbers from 0 to this one.
    Uniform(Expr),
    Normal(Expr, Expr),
    Beta(f64, f64),
    Poisson(Expr),
    /// Only as a surrogate: the first stage leaves the observation out.
    Flat,
}

/// The right-hand side of a binding.
#[derive(Clone, Debug)]
pub enum Right {
    Plain(Expr),
    /// A call of a function, as an index into [`Program::functions`].
    Call(usize, Vec<Expr>),
    /// A call of a memoised function (`mem`).
    Memo(usize, Expr),
    /// A call of a recursive function, as an index into [`Program::recursions`].
    Recursion(usize),
    /// A conditional whose branches may draw.
    Branch(Expr, Body, Body),
}

#[derive(Clone, Debug)]
pub enum Def {
    Let(Id, Right),
    Draw(Id, Dist),
}

#[derive(Clone, Debug)]
pub struct Body {
    pub defs: Vec<Def>,
    pub result: Expr,
}

#[derive(Clone, Debug)]
pub struct Function {
    pub name: String,
    pub params: Vec<Id>,
    pub body: Body,
}

/// A function that calls itself with the next number while `again` holds: its value is then `step`
/// plus that of the call, otherwise `stop`.
#[derive(Clone, Debug)]
pub struct Recursion {
    pub name: String,
    pub param: Id,
    pub defs: Vec<Def>,
    pub again: Expr,
    pub step: Expr,
    pub stop: Expr,
}

#[derive(Clone, Debug)]
pub enum Effect {
    /// A named observation of a number (truth values are 0 and 1), with an optional
    /// surrogate.
    Observe(Id, Dist, f64, Option<Dist>),
    Factor(Expr),
    Guarded(Expr, Vec<Effect>),
}

#[derive(Clone, Debug)]
pub enum Item {
    /// The definition of a function, or of a memoised one, by index.
    Function(usize),
    Memo(usize),
    Recursion(usize),
    Def(Def),
    /// A prediction: nothing reads it, and no state contains it.
    Predict(Id, Dist),
    /// A loop with a number of iterations; its draws are keyed by the iteration.
    Loop(usize, Vec<Def>, Vec<Effect>),
    Effect(Effect),
}

/// A program without its `infer` block.
#[derive(Clone, Debug, Default)]
pub struct Program {
    pub names: Vec<String>,
    pub functions: Vec<Function>,
    pub memos: Vec<Function>,
    pub recursions: Vec<Recursion>,
    pub items: Vec<Item>,
}

impl Program {
    pub fn name(&mut self, text: &str) -> Id {
        self.names.push(format!("{text}{}", self.names.len()));
        self.names.len() - 1
    }

    /// Whether anything is observed or weighed.
    pub fn has_effects(&self) -> bool {
        self.items.iter().any(|i| match i {
            Item::Effect(_) => true,
            Item::Loop(_, _, effects) => !effects.is_empty(),
            _ => false,
        })
    }

    /// Returns the addresses of the choices whose values are recorded, by item: those of the top
    /// level, of loops, and predictions.
    pub fn recorded(&self) -> Vec<String> {
        let mut all = Vec::new();
        for item in &self.items {
            match item {
                Item::Def(Def::Draw(n, _)) | Item::Predict(n, _) => {
                    all.push(format!("@{}", self.names[*n]));
                }
                Item::Loop(passes, defs, _) => {
                    for d in defs {
                        let Def::Draw(n, _) = d else { continue };
                        all.extend((0..*passes).map(|i| format!("@{}[{i}]", self.names[*n])));
                    }
                }
                _ => {}
            }
        }
        all
    }

    fn list(&self, all: &[Expr]) -> String {
        all.iter().map(|e| self.expr(e)).collect::<Vec<_>>().join(", ")
    }

    fn expr(&self, e: &Expr) -> String {
        let two =
            |a: &Expr, op: &str, b: &Expr| format!("({} {op} {})", self.expr(a), self.expr(b));
        match e {
            Expr::Num(x) => format!("({x:?})"),
            Expr::Truth(b) => format!("{b}"),
            Expr::Ref(n) => self.names[*n].clone(),
            Expr::Pass => "i".into(),
            Expr::Element(n, k) => format!("{}[{}]", self.names[*n], self.expr(k)),
            Expr::Add(a, b) => two(a, "+", b),
            Expr::Mul(a, b) => two(a, "*", b),
            Expr::Equal(a, b) => two(a, "==", b),
            Expr::Less(a, b) => two(a, "<", b),
            Expr::And(a, b) => two(a, "and", b),
            Expr::Or(a, b) => two(a, "or", b),
            Expr::Not(a) => format!("(not {})", self.expr(a)),
            Expr::If(c, a, b) => {
                format!("(if {} {{ {} }} else {{ {} }})", self.expr(c), self.expr(a), self.expr(b))
            }
            Expr::Table(all, k) => format!("[{}][{}]", self.list(all), self.expr(k)),
        }
    }

    fn dist(&self, d: &Dist) -> String {
        match d {
            Dist::Flip(p) => format!("flip({})", self.expr(p)),
            Dist::Categorical(w) => format!("categorical([{}])", self.list(w)),
            Dist::Uniform(last) => format!("uniform_discrete(0, {})", self.expr(last)),
            Dist::Normal(m, s) => format!("normal({}, {})", self.expr(m), self.expr(s)),
            Dist::Beta(a, b) => format!("beta({a:?}, {b:?})"),
            Dist::Poisson(r) => format!("poisson({})", self.expr(r)),
            Dist::Flat => "flat()".into(),
        }
    }

    fn def(&self, d: &Def, keyed: bool, top: bool) -> String {
        match d {
            Def::Draw(n, d) if keyed => format!("{}[i] ~ {};", self.names[*n], self.dist(d)),
            Def::Draw(n, d) if top => format!("assume {} ~ {};", self.names[*n], self.dist(d)),
            Def::Draw(n, d) => format!("{} ~ {};", self.names[*n], self.dist(d)),
            Def::Let(n, right) => {
                let right = match right {
                    Right::Plain(e) => self.expr(e),
                    Right::Call(f, args) => {
                        format!("{}({})", self.functions[*f].name, self.list(args))
                    }
                    Right::Memo(f, arg) => format!("{}({})", self.memos[*f].name, self.expr(arg)),
                    Right::Recursion(f) => format!("{}(0)", self.recursions[*f].name),
                    Right::Branch(c, a, b) => {
                        format!(
                            "if {} {{ {} }} else {{ {} }}",
                            self.expr(c),
                            self.body(a),
                            self.body(b)
                        )
                    }
                };
                format!("let {} = {right};", self.names[*n])
            }
        }
    }

    fn body(&self, b: &Body) -> String {
        let defs: String = b.defs.iter().map(|d| self.def(d, false, false) + " ").collect();
        defs + &self.expr(&b.result)
    }

    fn effect(&self, e: &Effect) -> String {
        match e {
            Effect::Observe(name, d, y, coarse) => {
                let value = if matches!(d, Dist::Flip(_)) {
                    format!("{}", *y != 0.0)
                } else {
                    format!("{y:?}")
                };
                let coarse = coarse
                    .as_ref()
                    .map_or(String::new(), |c| format!(" with coarse = {}", self.dist(c)));
                format!("observe {} = {value}{coarse} as {};", self.dist(d), self.names[*name])
            }
            Effect::Factor(w) => format!("factor({});", self.expr(w)),
            Effect::Guarded(c, inner) => {
                let inner: String = inner.iter().map(|e| self.effect(e) + " ").collect();
                format!("if {} {{ {inner}}}", self.expr(c))
            }
        }
    }
}

impl Display for Program {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let params = |g: &Function| {
            g.params.iter().map(|p| self.names[*p].clone()).collect::<Vec<_>>().join(", ")
        };
        for item in &self.items {
            match item {
                Item::Function(i) => {
                    let g = &self.functions[*i];
                    writeln!(f, "fn {}({}) {{ {} }}", g.name, params(g), self.body(&g.body))?;
                }
                Item::Memo(i) => {
                    let g = &self.memos[*i];
                    writeln!(
                        f,
                        "let {} = mem(fn({}) {{ {} }});",
                        g.name,
                        params(g),
                        self.body(&g.body)
                    )?;
                }
                Item::Recursion(i) => {
                    let g = &self.recursions[*i];
                    let (name, k) = (&g.name, &self.names[g.param]);
                    let defs: String =
                        g.defs.iter().map(|d| self.def(d, false, false) + " ").collect();
                    let [again, step, stop] = [&g.again, &g.step, &g.stop].map(|e| self.expr(e));
                    writeln!(
                        f,
                        "fn {name}({k}) {{ {defs}if {again} {{ {step} + {name}({k} + 1) }} else {{ {stop} }} }}"
                    )?;
                }
                Item::Def(d) => writeln!(f, "{}", self.def(d, false, true))?,
                Item::Predict(n, d) => {
                    writeln!(f, "predict {} ~ {};", self.names[*n], self.dist(d))?;
                }
                Item::Effect(e) => writeln!(f, "{}", self.effect(e))?,
                Item::Loop(n, defs, effects) => {
                    let mut inner = String::new();
                    defs.iter()
                        .try_for_each(|d| writeln!(inner, "  {}", self.def(d, true, false)))?;
                    effects.iter().try_for_each(|e| writeln!(inner, "  {}", self.effect(e)))?;
                    writeln!(f, "for i in 0 .. {n} {{\n{inner}}}")?;
                }
            }
        }
        Ok(())
    }
}
