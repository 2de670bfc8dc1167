//! Evaluates programs lazily, with one execution for each combination of values of their
//! discrete choices: the posterior by enumeration.
//!
//! It shares nothing with the engine except the language: it walks trees, and starts
//! afresh for each execution.

use super::gaussian::{Affine, Gaussian, MOST};
use super::program::{
    Body, Def, Dist, Effect, Expr, Function, Id, Item, Program, Recursion, Right,
};
use super::steps::{self, QUARTERS};
use std::collections::HashMap;

/// The number of cells of the grid over which a choice is integrated. The numbers that
/// programs compare it with are at cell edges.
pub const CELLS: usize = 240;
/// The grid extends this far from 0, in both directions.
pub const REACH: f64 = 5.0;
/// The width of a cell.
pub const WIDTH: f64 = 2.0 * REACH / CELLS as f64;
/// The offsets of the two Gauss-Legendre points of a cell, where densities are evaluated,
/// from its middle, in cells.
pub const POINT: f64 = 0.288_675_134_594_812_9;

/// Returns the coordinate of a grid point.
fn point(i: usize) -> f64 {
    let away = if i.is_multiple_of(2) { -POINT } else { POINT };
    ((i / 2) as f64 + 0.5 + away) * WIDTH - REACH
}

/// How continuous choices are integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integration {
    /// Exactly: they are Gaussian, and everything is affine in them.
    Gaussian,
    /// On a grid: the program has a single standard normal choice.
    Grid,
    /// By quarters: the program has a single beta choice, and compares it with quarters only.
    Quarters,
}

/// What an execution evaluates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// What observations and factors need: the choices of a state.
    State,
    /// The choices that are recorded as well, whether anything reads them or not.
    Records,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Val {
    Num(Affine),
    Truth(bool),
}

/// The execution cannot be enumerated.
#[derive(Debug)]
pub struct Unsuitable;

type Result<T> = std::result::Result<T, Unsuitable>;

/// One possible execution of a program.
#[derive(Clone, Debug, Default)]
pub struct Execution {
    /// The discrete choices: address, value (truth values are 0 and 1), and whether it is
    /// Boolean.
    pub discrete: Vec<(String, f64, bool)>,
    /// The addresses of the continuous choices.
    pub continuous: Vec<String>,
    /// Residuals of priors and observations, normal around 0, with their standard
    /// deviations.
    pub residuals: Vec<(Affine, f64)>,
    /// The grid point of the continuous choice, two per cell, or its quarter.
    pub point: Option<usize>,
    /// The shapes of a beta choice.
    pub shapes: Option<(f64, f64)>,
    /// The log weight of everything else.
    pub log_weight: f64,
}

struct Frame<'p> {
    parent: Option<usize>,
    defs: &'p [Def],
    /// The prefix of addresses; empty at the top level and in loop iterations.
    prefix: String,
    pass: Option<usize>,
    args: Vec<(Id, &'p Expr, usize)>,
    /// Arguments that are already evaluated.
    keys: Vec<(Id, Val)>,
}

struct Run<'p> {
    program: &'p Program,
    integration: Integration,
    top: Vec<&'p Def>,
    /// Containers by name: the loop and the distribution of its draws.
    containers: HashMap<Id, (usize, &'p Dist)>,
    frames: Vec<Frame<'p>>,
    known: HashMap<(usize, Id), Val>,
    passes: HashMap<(usize, usize), usize>,
    entries: HashMap<(usize, u64), usize>,
    /// For each choice, in order of first use: the index of its value, and its number of
    /// values.
    script: Vec<(usize, usize)>,
    asked: usize,
    out: Execution,
    steps: usize,
}

/// Enumerates the executions of a program that have positive probability.
pub fn executions(
    program: &Program,
    integration: Integration,
    extent: Extent,
    most: usize,
    mut each: impl FnMut(Execution),
) -> Result<()> {
    let mut script: Vec<(usize, usize)> = Vec::new();
    let most = match integration {
        Integration::Gaussian => most,
        Integration::Grid => 2 * CELLS * most,
        Integration::Quarters => QUARTERS * most,
    };
    for _ in 0..most {
        let mut run = Run::new(program, integration, script);
        run.everything(extent)?;
        if run.out.log_weight > f64::NEG_INFINITY {
            run.out.discrete.sort_by(|a, b| a.0.cmp(&b.0));
            each(run.out);
        }
        script = run.script;
        script.truncate(run.asked);
        while let Some((value, of)) = script.last_mut() {
            *value += 1;
            if value < of {
                break;
            }
            script.pop();
        }
        if script.is_empty() {
            return Ok(());
        }
    }
    Err(Unsuitable)
}

fn normal(x: f64, sd: f64) -> f64 {
    -0.5 * (x / sd).powi(2) - sd.ln() - 0.918_938_533_204_672_8
}

impl<'p> Run<'p> {
    fn new(program: &'p Program, integration: Integration, script: Vec<(usize, usize)>) -> Self {
        let (mut top, mut containers) = (Vec::new(), HashMap::new());
        for (i, item) in program.items.iter().enumerate() {
            match item {
                Item::Def(d) => top.push(d),
                Item::Loop(_, defs, _) => {
                    let drawn = |d: &'p Def| {
                        if let Def::Draw(n, d) = d { Some((*n, (i, d))) } else { None }
                    };
                    containers.extend(defs.iter().filter_map(drawn));
                }
                _ => {}
            }
        }
        let root = Frame {
            parent: None,
            defs: &[],
            prefix: String::new(),
            pass: None,
            args: Vec::new(),
            keys: Vec::new(),
        };
        Run {
            program,
            integration,
            top,
            containers,
            frames: vec![root],
            known: HashMap::new(),
            passes: HashMap::new(),
            entries: HashMap::new(),
            script,
            asked: 0,
            out: Execution::default(),
            steps: 0,
        }
    }

    fn everything(&mut self, extent: Extent) -> Result<()> {
        let program = self.program;
        for (i, item) in program.items.iter().enumerate() {
            match item {
                Item::Effect(e) => self.effect(e, 0)?,
                Item::Loop(n, _, effects) => {
                    for pass in 0..*n {
                        let f = self.pass(i, pass)?;
                        effects.iter().try_for_each(|e| self.effect(e, f))?;
                    }
                }
                _ => {}
            }
        }
        if extent == Extent::Records { self.records() } else { Ok(()) }
    }

    fn records(&mut self) -> Result<()> {
        let program = self.program;
        for (i, item) in program.items.iter().enumerate() {
            match item {
                Item::Def(Def::Draw(n, _)) => drop(self.lookup(*n, 0)?),
                Item::Predict(n, d) => drop(self.choose(d, 0, self.address(0, *n))?),
                Item::Loop(passes, defs, _) => {
                    for pass in 0..*passes {
                        let f = self.pass(i, pass)?;
                        for d in defs {
                            let Def::Draw(n, _) = d else { continue };
                            self.lookup(*n, f)?;
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn pass(&mut self, item: usize, pass: usize) -> Result<usize> {
        if let Some(f) = self.passes.get(&(item, pass)) {
            return Ok(*f);
        }
        let Item::Loop(n, defs, _) = &self.program.items[item] else { return Err(Unsuitable) };
        if pass >= *n {
            return Err(Unsuitable);
        }
        let f = self.frame(0, defs, String::new(), Some(pass));
        self.passes.insert((item, pass), f);
        Ok(f)
    }

    fn frame(
        &mut self,
        parent: usize,
        defs: &'p [Def],
        prefix: String,
        pass: Option<usize>,
    ) -> usize {
        self.frames.push(Frame {
            parent: Some(parent),
            defs,
            prefix,
            pass,
            args: Vec::new(),
            keys: Vec::new(),
        });
        self.frames.len() - 1
    }

    /// Returns the address of a name bound in a frame.
    fn address(&self, f: usize, n: Id) -> String {
        let (frame, name) = (&self.frames[f], &self.program.names[n]);
        match frame.pass {
            _ if !frame.prefix.is_empty() => format!("{}/{name}", frame.prefix),
            Some(pass) => format!("@{name}[{pass}]"),
            None => format!("@{name}"),
        }
    }

    fn effect(&mut self, e: &'p Effect, f: usize) -> Result<()> {
        match e {
            Effect::Factor(w) => {
                self.out.log_weight += self.number(w, f)?;
                Ok(())
            }
            Effect::Guarded(c, inner) => match self.truth(c, f)? {
                true => inner.iter().try_for_each(|e| self.effect(e, f)),
                false => Ok(()),
            },
            Effect::Observe(_, d, y, _) => {
                self.out.log_weight += match d {
                    Dist::Normal(m, s) => {
                        let (m, s) = (self.affine(m, f)?, self.number(s, f)?);
                        let residual = Affine::number(*y)
                            .plus(&m.times(&Affine::number(-1.0)).ok_or(Unsuitable)?);
                        match s > 0.0 {
                            false => f64::NEG_INFINITY,
                            true if m.is_number() => normal(residual.constant, s),
                            true => {
                                self.out.residuals.push((residual, s));
                                0.0
                            }
                        }
                    }
                    Dist::Poisson(r) => {
                        let r = self.number(r, f)?;
                        if r > 0.0 {
                            y * r.ln() - r - (1..=*y as u64).map(|k| (k as f64).ln()).sum::<f64>()
                        } else {
                            f64::NEG_INFINITY
                        }
                    }
                    _ => {
                        let values = self.values(d, f)?;
                        values.iter().find(|(v, _)| v == y).map_or(f64::NEG_INFINITY, |(_, l)| *l)
                    }
                };
                Ok(())
            }
        }
    }

    /// Returns the values of a discrete distribution with their log probabilities; empty
    /// if its parameters are invalid.
    fn values(&mut self, d: &'p Dist, f: usize) -> Result<Vec<(f64, f64)>> {
        Ok(match d {
            Dist::Flip(p) => {
                let p = self.number(p, f)?;
                if (0.0..=1.0).contains(&p) {
                    vec![(0.0, (1.0 - p).ln()), (1.0, p.ln())]
                } else {
                    Vec::new()
                }
            }
            Dist::Categorical(w) => {
                let w = w.iter().map(|w| self.number(w, f)).collect::<Result<Vec<f64>>>()?;
                let total: f64 = w.iter().sum();
                w.iter().enumerate().map(|(i, w)| (i as f64, (w / total).ln())).collect()
            }
            Dist::Uniform(last) => {
                let last = self.number(last, f)? as usize;
                (0..=last).map(|i| (i as f64, -((last + 1) as f64).ln())).collect()
            }
            _ => return Err(Unsuitable),
        })
    }

    /// Returns the value of a choice at its first use.
    fn choose(&mut self, d: &'p Dist, f: usize, address: String) -> Result<Val> {
        if let Dist::Normal(m, s) = d {
            let (m, s) = (self.affine(m, f)?, self.number(s, f)?);
            if self.integration == Integration::Gaussian {
                let i = self.out.continuous.len();
                if i == MOST {
                    return Err(Unsuitable);
                }
                let own = Affine::choice(i);
                self.out
                    .residuals
                    .push((own.plus(&m.times(&Affine::number(-1.0)).ok_or(Unsuitable)?), s));
                self.out.continuous.push(address);
                return Ok(Val::Num(own));
            }
            if m != Affine::number(0.0) || s != 1.0 || self.out.point.is_some() {
                return Err(Unsuitable);
            }
            let i = self.pick(2 * CELLS);
            let x = point(i);
            self.out.log_weight += normal(x, 1.0) + WIDTH.ln();
            self.out.continuous.push(address);
            self.out.point = Some(i);
            return Ok(Val::Num(Affine::number(x)));
        }
        if let Dist::Beta(a, b) = d {
            let i = self.pick(QUARTERS);
            self.out.log_weight += steps::mass((*a, *b), i).ln();
            self.out.continuous.push(address);
            (self.out.point, self.out.shapes) = (Some(i), Some((*a, *b)));
            return Ok(Val::Num(Affine::number((i as f64 + 0.5) / QUARTERS as f64)));
        }
        let values = self.values(d, f)?;
        if values.is_empty() {
            return Err(Unsuitable);
        }
        let (value, log) = values[self.pick(values.len())];
        self.out.log_weight += log;
        let is_truth = matches!(d, Dist::Flip(_));
        self.out.discrete.push((address, value, is_truth));
        Ok(if is_truth { Val::Truth(value != 0.0) } else { Val::Num(Affine::number(value)) })
    }

    /// Returns the next value index of the script.
    fn pick(&mut self, of: usize) -> usize {
        if self.asked == self.script.len() {
            self.script.push((0, of));
        }
        self.asked += 1;
        self.script[self.asked - 1].0
    }

    fn lookup(&mut self, n: Id, from: usize) -> Result<Val> {
        let mut at = Some(from);
        while let Some(f) = at {
            if let Some(v) = self.known.get(&(f, n)) {
                return Ok(*v);
            }
            if let Some((_, v)) = self.frames[f].keys.iter().find(|(k, _)| *k == n) {
                return Ok(*v);
            }
            let found = if let Some((_, e, home)) =
                self.frames[f].args.iter().find(|(k, _, _)| *k == n).copied()
            {
                Some(self.eval(e, home)?)
            } else {
                let named = |d: &&'p Def| matches!(d, Def::Let(k, _) | Def::Draw(k, _) if *k == n);
                let def = if f == 0 {
                    self.top.iter().copied().find(named)
                } else {
                    self.frames[f].defs.iter().find(named)
                };
                def.map(|d| self.define(d, f)).transpose()?
            };
            if let Some(v) = found {
                self.known.insert((f, n), v);
                return Ok(v);
            }
            at = self.frames[f].parent;
        }
        Err(Unsuitable)
    }

    fn define(&mut self, d: &'p Def, f: usize) -> Result<Val> {
        match d {
            Def::Draw(n, dist) => {
                let address = self.address(f, *n);
                self.choose(dist, f, address)
            }
            Def::Let(n, right) => {
                let binding = self.address(f, *n);
                match right {
                    Right::Plain(e) => self.eval(e, f),
                    Right::Branch(c, a, b) => {
                        let body = if self.truth(c, f)? { a } else { b };
                        let inner = self.frame(f, &body.defs, binding, None);
                        self.eval(&body.result, inner)
                    }
                    Right::Call(g, args) => {
                        let g: &'p Function = &self.program.functions[*g];
                        let inner =
                            self.frame(0, &g.body.defs, format!("{binding}/{}", g.name), None);
                        self.frames[inner].args =
                            g.params.iter().zip(args).map(|(p, a)| (*p, a, f)).collect();
                        self.eval(&g.body.result, inner)
                    }
                    Right::Recursion(g) => self.recursion(&self.program.recursions[*g], binding, 0),
                    Right::Memo(g, arg) => {
                        let key = self.eval(arg, f)?;
                        self.memo(*g, key)
                    }
                }
            }
        }
    }

    fn recursion(&mut self, g: &'p Recursion, from: String, depth: usize) -> Result<Val> {
        let prefix = format!("{from}/{}", g.name);
        let inner = self.frame(0, &g.defs, prefix.clone(), None);
        self.frames[inner].keys = vec![(g.param, Val::Num(Affine::number(depth as f64)))];
        if !self.truth(&g.again, inner)? {
            return self.eval(&g.stop, inner);
        }
        let step = self.affine(&g.step, inner)?;
        let Val::Num(rest) = self.recursion(g, prefix, depth + 1)? else { return Err(Unsuitable) };
        Ok(Val::Num(step.plus(&rest)))
    }

    fn memo(&mut self, g: usize, key: Val) -> Result<Val> {
        let function: &'p Function = &self.program.memos[g];
        let (bits, shown) = match key {
            Val::Num(a) if a.is_number() => (a.constant.to_bits(), format!("{}", a.constant)),
            Val::Num(_) => return Err(Unsuitable),
            Val::Truth(b) => (u64::from(b), format!("{b}")),
        };
        let body: &'p Body = &function.body;
        let inner = match self.entries.get(&(g, bits)) {
            Some(f) => *f,
            None => {
                let f = self.frame(0, &body.defs, format!("@{}[{shown}]/fn", function.name), None);
                self.frames[f].keys = vec![(function.params[0], key)];
                self.entries.insert((g, bits), f);
                f
            }
        };
        self.eval(&body.result, inner)
    }

    fn affine(&mut self, e: &'p Expr, f: usize) -> Result<Affine> {
        match self.eval(e, f)? {
            Val::Num(a) => Ok(a),
            Val::Truth(_) => Err(Unsuitable),
        }
    }

    fn number(&mut self, e: &'p Expr, f: usize) -> Result<f64> {
        let a = self.affine(e, f)?;
        if a.is_number() { Ok(a.constant) } else { Err(Unsuitable) }
    }

    fn truth(&mut self, e: &'p Expr, f: usize) -> Result<bool> {
        match self.eval(e, f)? {
            Val::Truth(b) => Ok(b),
            Val::Num(_) => Err(Unsuitable),
        }
    }

    fn eval(&mut self, e: &'p Expr, f: usize) -> Result<Val> {
        self.steps += 1;
        if self.steps > 20_000 {
            return Err(Unsuitable);
        }
        let num = |x: f64| Ok(Val::Num(Affine::number(x)));
        match e {
            Expr::Num(x) => num(*x),
            Expr::Truth(b) => Ok(Val::Truth(*b)),
            Expr::Ref(n) => self.lookup(*n, f),
            Expr::Pass => {
                let mut at = Some(f);
                while let Some(g) = at {
                    if let Some(pass) = self.frames[g].pass {
                        return num(pass as f64);
                    }
                    at = self.frames[g].parent;
                }
                Err(Unsuitable)
            }
            Expr::Element(n, k) => {
                let k = self.number(k, f)?;
                if k < 0.0 || k != k.trunc() {
                    return Err(Unsuitable);
                }
                let (item, _) = *self.containers.get(n).ok_or(Unsuitable)?;
                let pass = self.pass(item, k as usize)?;
                self.lookup(*n, pass)
            }
            Expr::Add(a, b) => Ok(Val::Num(self.affine(a, f)?.plus(&self.affine(b, f)?))),
            Expr::Mul(a, b) => {
                let (a, b) = (self.affine(a, f)?, self.affine(b, f)?);
                a.times(&b).map(Val::Num).ok_or(Unsuitable)
            }
            Expr::Equal(a, b) => Ok(Val::Truth(self.number(a, f)? == self.number(b, f)?)),
            Expr::Less(a, b) => Ok(Val::Truth(self.number(a, f)? < self.number(b, f)?)),
            Expr::And(a, b) => Ok(Val::Truth(self.truth(a, f)? && self.truth(b, f)?)),
            Expr::Or(a, b) => Ok(Val::Truth(self.truth(a, f)? || self.truth(b, f)?)),
            Expr::Not(a) => Ok(Val::Truth(!self.truth(a, f)?)),
            Expr::If(c, a, b) => {
                let taken = if self.truth(c, f)? { a } else { b };
                self.eval(taken, f)
            }
            Expr::Table(all, k) => {
                // All elements of an array are evaluated, whichever is read.
                let values = all.iter().map(|e| self.eval(e, f)).collect::<Result<Vec<Val>>>()?;
                let k = self.number(k, f)?;
                values
                    .get(k as usize)
                    .copied()
                    .filter(|_| k >= 0.0 && k == k.trunc())
                    .ok_or(Unsuitable)
            }
        }
    }
}

impl Execution {
    /// Returns the Gaussian choices given the observations.
    pub fn gaussian(&self) -> Gaussian {
        Gaussian::new(self.continuous.len(), &self.residuals)
    }
}
