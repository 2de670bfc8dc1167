//! Random programs whose posteriors can be enumerated: a few discrete choices that are
//! combined in conditions, tables, loops, functions, `mem`, choices and observations that
//! appear and vanish, and continuous choices on which all of these may depend.

use super::execute::Integration;
use super::program::{
    Body, Def, Dist, Effect, Expr, Function, Id, Item, Program, Recursion, Right,
};
use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};

/// The expressions in scope: discrete names with their greatest value, and numbers that
/// may be affine in Gaussian choices.
#[derive(Clone, Default)]
struct SiteSelection {
    truths: Vec<Expr>,
    counts: Vec<(Expr, usize)>,
    reals: Vec<Expr>,
    /// The choice that is integrated on the grid, or by quarters.
    grid: Option<Expr>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Truth,
    Count,
    Real,
}

struct Generator {
    rng: Stream,
    program: Program,
    integration: Integration,
    scope: SiteSelection,
    functions: Vec<(Vec<Kind>, Kind)>,
    memos: Vec<(Kind, Kind)>,
    /// Whether wide programs have one of their features. Others have none, and draw nothing from
    /// this stream, so that seeds keep their programs.
    wide: Option<Stream>,
}

/// Returns a random program, and how its continuous choices are integrated.
pub fn program(seed: u64) -> (Program, Integration) {
    generate(seed, None)
}

/// Returns a random program that may also lack data, have choices that nothing reads, predictions,
/// recursion, probabilities near or at 0 and 1, and densities with poles.
pub fn wide(seed: u64) -> (Program, Integration) {
    generate(seed, Some(StreamKey::new(seed, 1, Purpose::VALUES).stream(0, 0, 0)))
}

fn generate(seed: u64, mut wide: Option<Stream>) -> (Program, Integration) {
    let mut rng = StreamKey::new(seed, 0, Purpose::VALUES).stream(0, 0, 0);
    let mut integration =
        if rng.uniform() < 0.25 { Integration::Grid } else { Integration::Gaussian };
    if integration == Integration::Grid && wide.as_mut().is_some_and(|w| w.uniform() < 0.5) {
        integration = Integration::Quarters;
    }
    let (program, scope) = (Program::default(), SiteSelection::default());
    let (functions, memos) = (Vec::new(), Vec::new());
    let mut g = Generator { rng, program, integration, scope, functions, memos, wide };
    g.fill();
    (g.program, integration)
}

fn boxed(e: Expr) -> Box<Expr> {
    Box::new(e)
}

impl Generator {
    fn chance(&mut self, p: f64) -> bool {
        self.rng.uniform() < p
    }

    fn is_wide(&mut self, p: f64) -> bool {
        self.wide.as_mut().is_some_and(|w| w.uniform() < p)
    }

    fn among(&mut self, from: usize, to: usize) -> usize {
        from + self.rng.index(to - from + 1)
    }

    /// Returns a random multiple of a tenth.
    fn tenths(&mut self, from: i32, to: i32) -> f64 {
        f64::from(from + self.rng.index((to - from + 1) as usize) as i32) / 10.0
    }

    fn fill(&mut self) {
        for _ in 0..self.among(1, 3) {
            self.discrete_top();
        }
        let discrete_only = self.integration == Integration::Gaussian && self.chance(0.25);
        match self.integration {
            Integration::Grid => {
                let x = self.program.name("x");
                let (zero, one) = (Expr::Num(0.0), Expr::Num(1.0));
                self.program.items.push(Item::Def(Def::Draw(x, Dist::Normal(zero, one))));
                self.scope.grid = Some(Expr::Ref(x));
                self.scope.reals.push(Expr::Ref(x));
            }
            Integration::Quarters => {
                let (x, shapes) = (self.program.name("x"), [0.1, 0.5, 2.0]);
                let (a, b) = (shapes[self.rng.index(3)], shapes[self.rng.index(3)]);
                self.program.items.push(Item::Def(Def::Draw(x, Dist::Beta(a, b))));
                self.scope.grid = Some(Expr::Ref(x));
            }
            Integration::Gaussian if discrete_only => {}
            Integration::Gaussian => {
                for _ in 0..self.among(1, 2) {
                    let d = self.gaussian();
                    let x = self.program.name("x");
                    self.program.items.push(Item::Def(Def::Draw(x, d)));
                    self.scope.reals.push(Expr::Ref(x));
                }
                if self.chance(0.35) {
                    self.components();
                }
            }
        }
        if self.is_wide(0.5) {
            let d = self.unread("e");
            self.program.items.push(Item::Def(d));
        }
        for _ in 0..self.among(0, 1) {
            self.function();
        }
        if self.is_wide(0.4) {
            self.recursion();
        }
        if self.chance(0.35) {
            self.memo();
        }
        for _ in 0..self.among(0, 2) {
            let d = self.binding();
            self.program.items.push(Item::Def(d));
        }
        if self.chance(0.7) {
            self.looped();
        }
        for _ in 0..self.among(0, 1) {
            let d = self.binding();
            self.program.items.push(Item::Def(d));
        }
        for _ in 0..self.among(1, 2) {
            let e = self.effect(2);
            self.program.items.push(Item::Effect(e));
        }
        while self.is_wide(0.35) {
            if let Def::Draw(n, d) = self.unread("q") {
                self.program.items.push(Item::Predict(n, d));
            }
        }
        if self.is_wide(0.15) {
            self.program.items.retain(|i| !matches!(i, Item::Effect(_)));
            for item in &mut self.program.items {
                if let Item::Loop(_, _, effects) = item {
                    effects.clear();
                }
            }
        }
    }

    /// Returns a draw that nothing reads.
    fn unread(&mut self, name: &str) -> Def {
        let n = self.program.name(name);
        let is_gaussian = self.integration == Integration::Gaussian && self.chance(0.4);
        Def::Draw(n, if is_gaussian { self.gaussian() } else { self.discrete().0 })
    }

    /// Adds a recursive function of up to three calls, and the value of one: a count of its calls,
    /// or a sum of numbers that are drawn in each.
    fn recursion(&mut self) {
        let (param, s) = (self.program.name("k"), self.program.name("s"));
        let outside = self.scope.clone();
        self.scope.counts.push((Expr::Ref(param), 2));
        let mut defs = vec![Def::Draw(s, Dist::Flip(self.probability(1)))];
        let (mut step, mut stop) = (Expr::Num(1.0), Expr::Num(0.0));
        let is_real = self.integration == Integration::Gaussian && self.chance(0.5);
        if is_real {
            let u = self.program.name("u");
            defs.push(Def::Draw(u, self.gaussian()));
            step = Expr::Ref(u);
            if self.chance(0.5) {
                stop = Expr::Ref(u);
            }
        }
        self.scope = outside;
        let more = Expr::Less(boxed(Expr::Ref(param)), boxed(Expr::Num(1.5)));
        let again = Expr::And(boxed(Expr::Ref(s)), boxed(more));
        let (i, n) = (self.program.recursions.len(), self.program.name("l"));
        let name = format!("r{i}");
        self.program.recursions.push(Recursion { name, param, defs, again, step, stop });
        self.program.items.push(Item::Recursion(i));
        self.program.items.push(Item::Def(Def::Let(n, Right::Recursion(i))));
        match is_real {
            true => self.scope.reals.push(Expr::Ref(n)),
            false => self.scope.counts.push((Expr::Ref(n), 2)),
        }
    }

    fn discrete_top(&mut self) {
        let (d, most) = self.discrete();
        let n = self.program.name("d");
        self.program.items.push(Item::Def(Def::Draw(n, d)));
        self.know(Expr::Ref(n), most);
    }

    fn know(&mut self, e: Expr, most: Option<usize>) {
        match most {
            None => self.scope.truths.push(e),
            Some(k) => self.scope.counts.push((e, k)),
        }
    }

    /// Returns a discrete distribution, with its greatest value if it is numeric.
    fn discrete(&mut self) -> (Dist, Option<usize>) {
        match self.rng.index(5) {
            0 | 1 => (Dist::Flip(self.probability(1)), None),
            2 | 3 => {
                let k = self.among(2, 3);
                let weights = (0..k).map(|_| self.weight()).collect();
                (Dist::Categorical(weights), Some(k - 1))
            }
            _ => {
                let k = self.among(1, 2);
                let last = if self.chance(0.3) {
                    let c = self.condition(1);
                    Expr::If(boxed(c), boxed(Expr::Num(k as f64)), boxed(Expr::Num(1.0)))
                } else {
                    Expr::Num(k as f64)
                };
                (Dist::Uniform(last), Some(k.max(1)))
            }
        }
    }

    fn weight(&mut self) -> Expr {
        let w = Expr::Num(self.tenths(2, 30));
        if self.chance(0.2) {
            let (c, v) = (self.condition(1), Expr::Num(self.tenths(2, 30)));
            return Expr::If(boxed(c), boxed(w), boxed(v));
        }
        w
    }

    fn gaussian(&mut self) -> Dist {
        let m = if self.chance(0.5) { Expr::Num(self.tenths(-10, 10)) } else { self.real(1) };
        let s = self.tenths(5, 20);
        Dist::Normal(m, self.spread(s))
    }

    fn spread(&mut self, s: f64) -> Expr {
        if self.chance(0.2) {
            let c = self.condition(1);
            return Expr::If(boxed(c), boxed(Expr::Num(s)), boxed(Expr::Num(s * 2.0)));
        }
        Expr::Num(s)
    }

    /// Adds components that labels select.
    fn components(&mut self) {
        let (n, mu) = (self.among(2, 3), self.program.name("mu"));
        let s = Expr::Num(self.tenths(5, 20));
        let d = Def::Draw(mu, Dist::Normal(Expr::Num(0.0), s));
        self.program.items.push(Item::Loop(n, vec![d], Vec::new()));
        for i in 0..self.scope.counts.len() {
            let (k, most) = self.scope.counts[i].clone();
            if most < n {
                self.scope.reals.push(Expr::Element(mu, boxed(k)));
            }
        }
        let at = self.rng.index(n) as f64;
        self.scope.reals.push(Expr::Element(mu, boxed(Expr::Num(at))));
    }

    /// Returns a condition on up to 2^depth choices.
    fn condition(&mut self, depth: usize) -> Expr {
        if depth > 0 && self.chance(0.75) {
            let a = boxed(self.condition(depth - 1));
            let b = boxed(self.condition(depth - 1));
            return match self.rng.index(5) {
                0 | 1 => Expr::And(a, b),
                2 => Expr::Or(a, b),
                3 => Expr::Not(a),
                _ => Expr::And(a, boxed(Expr::Not(b))),
            };
        }
        let (t, c) = (self.scope.truths.len(), self.scope.counts.len());
        if let Some(x) = self.scope.grid.clone()
            && self.chance(0.25)
        {
            let at = 0.25 * (self.rng.index(9) as f64 - 4.0);
            return Expr::Less(boxed(x), boxed(Expr::Num(at)));
        }
        match self.rng.index(t + c + usize::from(t + c == 0)) {
            _ if t + c == 0 => Expr::Truth(self.chance(0.5)),
            i if i < t => self.scope.truths[i].clone(),
            i => {
                let (e, most) = self.scope.counts[i - t].clone();
                let k = self.rng.index(most + 1) as f64;
                match self.rng.index(4) {
                    0 => Expr::Less(boxed(e), boxed(Expr::Num(k + 0.5))),
                    1 if c > 1 => {
                        let other = self.scope.counts[self.rng.index(c)].0.clone();
                        Expr::Equal(boxed(e), boxed(other))
                    }
                    _ => Expr::Equal(boxed(e), boxed(Expr::Num(k))),
                }
            }
        }
    }

    fn probability(&mut self, depth: usize) -> Expr {
        if self.is_wide(0.15) {
            return Expr::Num(if self.chance(0.5) { 1e-6 } else { 1.0 - 1e-6 });
        }
        let p = self.tenths(1, 9);
        match self.rng.index(4) {
            0 if depth > 0 => {
                let c = self.condition(1);
                let (a, b) = (self.probability(depth - 1), self.probability(depth - 1));
                Expr::If(boxed(c), boxed(a), boxed(b))
            }
            1 if depth > 0 && !self.scope.counts.is_empty() => {
                let (e, most) = self.scope.counts[self.rng.index(self.scope.counts.len())].clone();
                let all = (0..=most).map(|_| Expr::Num(self.tenths(1, 9))).collect();
                Expr::Table(all, boxed(e))
            }
            _ => Expr::Num(p),
        }
    }

    fn real(&mut self, depth: usize) -> Expr {
        let n = self.scope.reals.len();
        if depth == 0 {
            return match self.rng.index(3) {
                0 | 1 if n > 0 => self.scope.reals[self.rng.index(n)].clone(),
                _ => Expr::Num(self.tenths(-20, 20)),
            };
        }
        match self.rng.index(7) {
            0..=2 => {
                let c = self.condition(2);
                let (a, b) = (self.real(depth - 1), self.real(depth - 1));
                Expr::If(boxed(c), boxed(a), boxed(b))
            }
            3 if !self.scope.counts.is_empty() => {
                let (e, most) = self.scope.counts[self.rng.index(self.scope.counts.len())].clone();
                let all = (0..=most).map(|_| self.real(depth - 1)).collect();
                Expr::Table(all, boxed(e))
            }
            4 => {
                let (a, b) = (self.real(depth - 1), self.real(depth - 1));
                Expr::Add(boxed(a), boxed(b))
            }
            5 => Expr::Mul(boxed(Expr::Num(self.tenths(-15, 15))), boxed(self.real(depth - 1))),
            _ => self.real(depth - 1),
        }
    }

    fn of_kind(&mut self, kind: Kind) -> Expr {
        match kind {
            Kind::Truth => self.condition(1),
            Kind::Real => self.real(1),
            Kind::Count if self.scope.counts.is_empty() => Expr::Num(self.rng.index(2) as f64),
            Kind::Count => {
                let i = self.rng.index(self.scope.counts.len());
                let (e, most) = self.scope.counts[i].clone();
                if most <= 1 {
                    e
                } else {
                    Expr::If(
                        boxed(Expr::Less(boxed(e.clone()), boxed(Expr::Num(1.5)))),
                        boxed(e),
                        boxed(Expr::Num(1.0)),
                    )
                }
            }
        }
    }

    fn kind(&mut self) -> Kind {
        [Kind::Truth, Kind::Count, Kind::Real][self.rng.index(3)]
    }

    /// Returns draws and a result of some kind, which may depend on them; counts are 0 or
    /// 1.
    fn body(&mut self, kind: Kind, draws: usize) -> Body {
        let outside = self.scope.clone();
        let mut defs = Vec::new();
        for _ in 0..draws {
            let is_gaussian = self.integration == Integration::Gaussian
                && !self.scope.reals.is_empty()
                && self.chance(0.3);
            if is_gaussian {
                let (d, n) = (self.gaussian(), self.program.name("u"));
                defs.push(Def::Draw(n, d));
                self.scope.reals.push(Expr::Ref(n));
            } else {
                let (d, most) = self.discrete();
                let n = self.program.name("w");
                defs.push(Def::Draw(n, d));
                self.know(Expr::Ref(n), most);
            }
        }
        let result = self.of_kind(kind);
        self.scope = outside;
        Body { defs, result }
    }

    fn function(&mut self) {
        let (takes, gives) = (self.kind(), self.kind());
        let param = self.program.name("p");
        let outside = self.scope.clone();
        self.take(param, takes);
        let draws = self.among(0, 1);
        let body = self.body(gives, draws);
        self.scope = outside;
        let name = format!("f{}", self.functions.len());
        self.program.items.push(Item::Function(self.program.functions.len()));
        self.program.functions.push(Function { name, params: vec![param], body });
        self.functions.push((vec![takes], gives));
    }

    fn memo(&mut self) {
        let takes = if self.chance(0.5) { Kind::Truth } else { Kind::Count };
        let gives = self.kind();
        let param = self.program.name("p");
        let outside = self.scope.clone();
        self.take(param, takes);
        let body = self.body(gives, 1);
        self.scope = outside;
        let name = format!("h{}", self.memos.len());
        self.program.items.push(Item::Memo(self.program.memos.len()));
        self.program.memos.push(Function { name, params: vec![param], body });
        self.memos.push((takes, gives));
    }

    fn take(&mut self, param: Id, kind: Kind) {
        match kind {
            Kind::Truth => self.scope.truths.push(Expr::Ref(param)),
            Kind::Count => self.scope.counts.push((Expr::Ref(param), 1)),
            Kind::Real => self.scope.reals.push(Expr::Ref(param)),
        }
    }

    /// Binds a name to a derived value.
    fn binding(&mut self) -> Def {
        let (right, kind) = match self.rng.index(5) {
            0 if !self.functions.is_empty() => {
                let i = self.rng.index(self.functions.len());
                let (takes, gives) = self.functions[i].clone();
                (Right::Call(i, takes.iter().map(|k| self.of_kind(*k)).collect()), gives)
            }
            1 | 2 if !self.memos.is_empty() => {
                let i = self.rng.index(self.memos.len());
                let (takes, gives) = self.memos[i];
                (Right::Memo(i, self.of_kind(takes)), gives)
            }
            3 => {
                let kind = self.kind();
                let c = self.condition(2);
                let (a, b) = (self.among(0, 1), self.among(0, 1));
                (Right::Branch(c, self.body(kind, a), self.body(kind, b)), kind)
            }
            _ => {
                let kind = self.kind();
                let e = if kind == Kind::Truth { self.condition(2) } else { self.of_kind(kind) };
                (Right::Plain(e), kind)
            }
        };
        let n = self.program.name("l");
        self.take(n, kind);
        Def::Let(n, right)
    }

    fn looped(&mut self) {
        let outside = self.scope.clone();
        let (passes, mut defs) = (self.among(2, 3), Vec::new());
        let mut drawn = Vec::new();
        for _ in 0..self.among(1, 2) {
            let z = self.program.name("z");
            let own = Expr::Element(z, boxed(Expr::Pass));
            if self.chance(0.3) {
                // A Markov chain of states.
                let before =
                    Expr::Element(z, boxed(Expr::Add(boxed(Expr::Pass), boxed(Expr::Num(-1.0)))));
                let (a, b, c) = (self.tenths(1, 9), self.tenths(1, 9), self.tenths(1, 9));
                let next = Expr::If(boxed(before), boxed(Expr::Num(a)), boxed(Expr::Num(b)));
                let first = Expr::Equal(boxed(Expr::Pass), boxed(Expr::Num(0.0)));
                defs.push(Def::Draw(
                    z,
                    Dist::Flip(Expr::If(boxed(first), boxed(Expr::Num(c)), boxed(next))),
                ));
                self.know(own, None);
                drawn.push((z, None));
            } else {
                let (d, most) = self.discrete();
                defs.push(Def::Draw(z, d));
                self.know(own, most);
                drawn.push((z, most));
            }
        }
        if self.chance(0.5) {
            let d = self.binding();
            defs.push(d);
        }
        if self.is_wide(0.3) {
            defs.push(self.unread("e"));
        }
        let effects = (0..self.among(1, 2)).map(|_| self.effect(1)).collect();
        self.program.items.push(Item::Loop(passes, defs, effects));
        // Choices of the loop can be read after it.
        self.scope = outside;
        for (z, most) in drawn {
            let at = self.rng.index(passes) as f64;
            self.know(Expr::Element(z, boxed(Expr::Num(at))), most);
        }
    }

    fn effect(&mut self, depth: usize) -> Effect {
        if depth > 0 && self.chance(0.15) {
            let c = self.condition(2);
            return Effect::Guarded(c, (0..self.among(1, 2)).map(|_| self.effect(0)).collect());
        }
        let name = self.program.name("y");
        match self.rng.index(6) {
            0 => {
                let p = self.probability(2);
                let softer = Expr::Add(
                    boxed(Expr::Mul(boxed(p.clone()), boxed(Expr::Num(0.7)))),
                    boxed(Expr::Num(0.1)),
                );
                let coarse = self.coarse([Dist::Flip(softer), Dist::Flip(Expr::Num(0.4))]);
                Effect::Observe(name, Dist::Flip(p), f64::from(u8::from(self.chance(0.5))), coarse)
            }
            1 => {
                let c = self.condition(3);
                let (mut a, b) = (self.tenths(-15, 5), self.tenths(-15, 5));
                if self.is_wide(0.3) {
                    a = f64::NEG_INFINITY;
                }
                Effect::Factor(Expr::If(boxed(c), boxed(Expr::Num(a)), boxed(Expr::Num(b))))
            }
            2 => {
                let (c, a, b) = (self.condition(2), self.tenths(3, 30), self.tenths(3, 30));
                let rate = Expr::If(boxed(c), boxed(Expr::Num(a)), boxed(Expr::Num(b)));
                Effect::Observe(name, Dist::Poisson(rate), self.rng.index(4) as f64, None)
            }
            _ => {
                let (m, s) = (self.real(2), self.tenths(4, 15));
                let shifted = Expr::Add(boxed(m.clone()), boxed(Expr::Num(0.4)));
                let wide = Dist::Normal(shifted, Expr::Num(s * 1.5));
                let blind = Dist::Normal(Expr::Num(0.3), Expr::Num(2.0));
                let coarse = self.coarse([wide, blind, Dist::Flat, Dist::Flat]);
                let s = match self.scope.grid.clone() {
                    // Invalid on one side of a number, unless a condition holds.
                    Some(x) if self.chance(0.2) => {
                        let at = 0.25 * (self.rng.index(9) as f64 - 4.0);
                        let side = Expr::Less(boxed(x), boxed(Expr::Num(at)));
                        let none =
                            Expr::If(boxed(side), boxed(Expr::Num(-1.0)), boxed(Expr::Num(s)));
                        Expr::If(boxed(self.condition(1)), boxed(Expr::Num(s)), boxed(none))
                    }
                    _ => self.spread(s),
                };
                Effect::Observe(name, Dist::Normal(m, s), self.tenths(-25, 25), coarse)
            }
        }
    }

    fn coarse<const N: usize>(&mut self, some: [Dist; N]) -> Option<Dist> {
        let i = self.rng.index(2 * N);
        some.into_iter().nth(i)
    }
}
