//! Random choices: drawn when first needed, and absorbing or changed after that.

use crate::lang::code::{Code, DistSpec, Operand};
use crate::lang::error::FaultKind;
use crate::lang::key::Key;
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::propose::{Change, Constraint};
use crate::trace::update::{Failure, Poll};
use pcadlang_numerics::dist::{Datum, Dist};
use smallvec::SmallVec;

impl Graph {
    pub(super) fn evaluate_draw(
        &mut self,
        code: &Code,
        n: NodeId,
        spec: &DistSpec,
        site: SiteId,
        keys: &[Operand],
    ) -> Result<Poll, Failure> {
        let frame = self.store[n].frame;
        let mut deps = Deps::new();
        let dist = match self.dist_now(code, n, frame, spec, &mut deps) {
            Ok(dist) => dist?,
            Err(m) => return self.need(code, m),
        };
        if let Some(step) = self.await_all(code, frame, keys)? {
            return Ok(step);
        }
        let stale = self.store[n].flags & WAS_STALE != 0;
        let own = match keys {
            [] => None,
            _ if stale && !self.any_changed(frame, keys) => self.own_hash(n),
            _ => Some(self.own_keyed(code, n, frame, site, keys)?),
        };
        if stale {
            let moved = own.is_some_and(|h| self.choice_hash(code, n) != h);
            if !moved && self.update_choice(code, n, &dist)? {
                self.set_deps(n, deps);
                return Ok(self.finish_unchanged(code, n));
            }
            // Invalidation stops at plain numbers, so the users of this one were not
            // invalidated for a change of its form.
            let was_told = self.store[n].flags & TARGET != 0 || self.may_be_redrawn(code, n);
            if !moved && !was_told {
                return Err(self.reformed(code, n));
            }
            self.retire_choice(code, n);
            if self.store[n].flags & HELD != 0 {
                let mut side: SmallVec<[NodeId; 4]> = SmallVec::new();
                self.each_side_dep(code, n, |d, _| side.push(d));
                side.iter().for_each(|d| self.release(*d, true));
            }
            self.set_side(n, None);
        }
        let hash = own.unwrap_or_else(|| self.site_hash(code, frame, site));
        let value = self.draw_fresh(code, n, &dist, hash, own)?;
        self.set_deps(n, deps);
        let epoch = self.update.epoch;
        let node = &mut self.store[n];
        node.value = value;
        node.changed = epoch;
        node.flags &= !TARGET;
        Ok(self.finish_unchanged(code, n))
    }

    fn reformed(&self, code: &Code, n: NodeId) -> Failure {
        let message = "the choice is a number, but its parameters became arrays".to_owned();
        let hint = "write two choices, one for each: if c { a ~ normal([0, 1], 1); a } else { b ~ normal(0, 1); b }";
        self.fail(code, n, FaultKind::Type, message, Some(hint.into()))
    }

    /// Whether one of these operands changed in this update.
    fn any_changed(&self, frame: FrameId, operands: &[Operand]) -> bool {
        let changed = |o: &Operand| {
            self.resolve(frame, *o).is_some_and(|d| self.store[d].changed == self.update.epoch)
        };
        operands.iter().any(changed)
    }

    fn own_keyed(
        &self,
        code: &Code,
        n: NodeId,
        frame: FrameId,
        site: SiteId,
        keys: &[Operand],
    ) -> Result<u64, Failure> {
        let own = self.own_keys(code, frame, keys);
        if own.len() < keys.len() {
            keys.iter()
                .try_for_each(|k| Key::of(self.value(code, frame, *k)).map(drop))
                .map_err(|f| self.fault(code, n, f))?;
        }
        Ok(self.own_keyed_hash(code, frame, site, &own))
    }

    /// Gives a choice its first value, from the constraints or the prior.
    fn draw_fresh(
        &mut self,
        code: &Code,
        n: NodeId,
        dist: &Dist,
        hash: u64,
        own: Option<u64>,
    ) -> Result<Value, Failure> {
        self.update.appeared += 1;
        self.set_improper(n, dist);
        if let Some(count) = dist.elements() {
            let mut stored = Vec::with_capacity(count);
            let mut scores = Vec::with_capacity(count);
            let whole = self.update.constraints.get(&hash).and_then(|c| c.whole(dist));
            for i in 0..count {
                let at = element_hash(hash, i);
                let one = dist.element(i);
                let given = whole.as_ref().and_then(|w| element(w, i));
                let given =
                    given.or_else(|| self.update.constraints.get(&at).and_then(|c| c.whole(&one)));
                let x = match &given {
                    Some(x) => x.clone(),
                    None => self.drawn_now(code, n, &one, at)?,
                };
                let score = one.log_density_stored(&x);
                self.score.add_prior(score, given.is_none());
                scores.push(score);
                stored.push(Value::from_datum(&x));
            }
            let side = ChoiceSide {
                stored: None,
                scores,
                elements: count as u32,
                hash: own,
                deps: Deps::new(),
            };
            self.set_side(n, Some(Side::Choice(side)));
            let own = (&self.store, &mut self.update);
            self.choices.register(own, code, n, hash, Some(count), dist);
            return Ok(Value::from_elements(stored));
        }
        let given = self.update.constraints.get(&hash).and_then(|c| c.whole(dist));
        let stored = match &given {
            Some(x) => x.clone(),
            None => self.drawn_now(code, n, dist, hash)?,
        };
        let score = dist.log_density_stored(&stored);
        self.score.add_prior(score, given.is_none());
        self.store[n].score = score;
        let whitened = dist.is_stored_whitened();
        let value = Value::from_datum(&if whitened {
            dist.from_noncentred(&stored)
        } else {
            stored.clone()
        });
        if whitened || own.is_some() {
            let side = ChoiceSide {
                stored: whitened.then_some(stored),
                scores: Vec::new(),
                elements: NONE,
                hash: own,
                deps: Deps::new(),
            };
            self.set_side(n, Some(Side::Choice(side)));
        }
        self.choices.register((&self.store, &mut self.update), code, n, hash, None, dist);
        Ok(value)
    }

    /// Draws from the prior, or in a first run where that is asked for uniformly.
    fn drawn_now(&self, code: &Code, n: NodeId, dist: &Dist, hash: u64) -> Result<Datum, Failure> {
        if dist.is_improper() && !self.update.starting {
            return Err(self.improper(code, n, dist));
        }
        let mut rng = self.update.draws.stream(hash);
        if let Some(width) = self.update.spread {
            let support = dist.stored_support();
            if !support.is_discrete() {
                let free: Vec<f64> =
                    (0..support.free_dim()).map(|_| width * (2.0 * rng.uniform() - 1.0)).collect();
                return Ok(support.from_free(&free).0);
            }
        }
        Ok(dist.sample_stored(&mut rng))
    }

    fn set_improper(&mut self, n: NodeId, dist: &Dist) {
        let flags = &mut self.store[n].flags;
        *flags = if dist.is_improper() { *flags | IMPROPER } else { *flags & !IMPROPER };
    }

    fn improper(&self, code: &Code, n: NodeId, dist: &Dist) -> Failure {
        let message = format!("`{}` is improper, so it cannot be sampled", dist.name());
        // Kernels reject such draws. Here no observation depends on the choice, so that no kernel
        // could move it either.
        let proper = match dist.name() {
            "ordered" => "order numbers of one distribution: ordered(normal(0, 1), 3)",
            _ => "give it a proper prior, such as normal(0, 10)",
        };
        let hint = format!("observe something that depends on it, or {proper}");
        self.fail(code, n, FaultKind::Domain, message, Some(hint))
    }

    /// Re-scores a choice under its distribution and applies the pending changes. False
    /// if its form no longer fits (number of elements or dimensions); it must then be
    /// resampled.
    fn update_choice(&mut self, code: &Code, n: NodeId, dist: &Dist) -> Result<bool, Failure> {
        if let Some(Side::Choice(c)) = self.store[n].side.as_deref()
            && c.elements != NONE
        {
            if dist.elements() != Some(c.elements as usize) {
                return Ok(false);
            }
            self.set_improper(n, dist);
            self.update_elements(code, n, dist)?;
            return Ok(true);
        }
        if dist.elements().is_some() {
            return Ok(false);
        }
        let whitened = dist.is_stored_whitened();
        let old = match self.stored(n) {
            Some(old) => old,
            None => return Ok(false),
        };
        if whitened != self.is_whitened(n) || !dist.stored_support().fits(&old) {
            return Ok(false);
        }
        self.set_improper(n, dist);
        let old_score = self.store[n].score;
        let mut change = None;
        if self.store[n].flags & TARGET != 0 {
            change =
                self.update.pending_of(n).find(|p| p.element == NONE).map(|p| p.change.clone());
        }
        let (new, from_prior) = match change {
            None => (None, false),
            Some(Change::Set(d)) => (Some(d), false),
            Some(Change::Value(d)) => match dist.to_noncentred(&d) {
                Some(x) => (Some(x), false),
                None => {
                    return Err(self.type_error(
                        code,
                        n,
                        "the value does not fit the choice".into(),
                    ));
                }
            },
            Some(Change::Resample) => {
                let hash = self.choice_hash(code, n);
                (Some(self.drawn_now(code, n, dist, hash)?), true)
            }
            Some(Change::Free(y)) => {
                let support = dist.stored_support();
                if support.free_dim() != y.len() {
                    let message = "the choice changed its dimension".to_owned();
                    return Err(self.fail(code, n, FaultKind::Domain, message, None));
                }
                let (x, jacobian) = support.from_free(&y);
                self.score.jacobian.add(jacobian);
                (Some(x), false)
            }
            Some(Change::White(z)) => {
                let coloured = if whitened { Some(Datum::Vec(z.into())) } else { dist.colour(&z) };
                match coloured {
                    Some(x) => (Some(x), true),
                    None => return Err(self.not_gaussian(code, n)),
                }
            }
        };
        let stored = new.as_ref().unwrap_or(&old);
        let score = dist.log_density_stored(stored);
        self.score.prior.sub(old_score);
        self.score.prior.add(score);
        if from_prior {
            self.score.undrawn.add(old_score);
            self.score.drawn.add(score);
            self.update.redrawn.push((n, NONE));
        }
        self.store[n].score = score;
        self.store[n].flags &= !TARGET;
        if new.is_some() || whitened {
            let value = Value::from_datum(&if whitened {
                dist.from_noncentred(stored)
            } else {
                stored.clone()
            });
            let epoch = self.update.epoch;
            let node = &mut self.store[n];
            if !value.same(&node.value) {
                node.value = value;
                node.changed = epoch;
            }
        }
        if let (Some(new), true) = (new, whitened)
            && let Some(Side::Choice(c)) = self.store[n].side.as_deref_mut()
        {
            self.update.note(Entry::Choice(n, Box::new(c.clone())));
            c.stored = Some(new);
        }
        Ok(true)
    }

    /// [`Graph::update_choice`] for a choice of several elements.
    fn update_elements(&mut self, code: &Code, n: NodeId, dist: &Dist) -> Result<(), Failure> {
        let hash = self.choice_hash(code, n);
        let Some(Side::Choice(side)) = self.store[n].side.as_deref() else {
            return Ok(());
        };
        let side = side.clone();
        let count = side.elements as usize;
        let old = self.store[n].value.clone();
        let mut xs: Vec<Datum> =
            (0..count).filter_map(|i| old.element(i).as_ref().and_then(Value::to_datum)).collect();
        let changes: SmallVec<[(u32, Change); 4]> = if self.store[n].flags & TARGET != 0 {
            self.update.pending_of(n).map(|p| (p.element, p.change.clone())).collect()
        } else {
            SmallVec::new()
        };
        let mut changed = false;
        for (element, change) in &changes {
            let range =
                if *element == NONE { 0..count } else { *element as usize..*element as usize + 1 };
            for i in range {
                let one = dist.element(i);
                let new = match change {
                    Change::Set(d) | Change::Value(d) if *element == NONE => self::element(d, i),
                    Change::Set(d) => Some(d.clone()),
                    Change::Value(d) => one.to_noncentred(d),
                    Change::Free(y) => {
                        let (x, jacobian) = one.stored_support().from_free(y);
                        self.score.jacobian.add(jacobian);
                        Some(x)
                    }
                    Change::Resample => {
                        Some(self.drawn_now(code, n, &one, element_hash(hash, i))?)
                    }
                    Change::White(z) if *element == NONE => {
                        z.get(i).and_then(|z| one.colour(&[*z]))
                    }
                    Change::White(z) => one.colour(z),
                };
                if let (Some(new), Some(x)) = (new, xs.get_mut(i)) {
                    if matches!(change, Change::Resample | Change::White(_)) {
                        self.score.undrawn.add(side.scores[i]);
                        self.score.drawn.add(one.log_density_stored(&new));
                        self.update.redrawn.push((n, i as u32));
                    }
                    *x = new;
                    changed = true;
                }
            }
        }
        let scores: Vec<f64> =
            xs.iter().enumerate().map(|(i, x)| dist.element_log_density(i, x)).collect();
        side.scores.iter().for_each(|s| self.score.prior.sub(*s));
        scores.iter().for_each(|s| self.score.prior.add(*s));
        self.update.note(Entry::Choice(n, Box::new(side)));
        if let Some(Side::Choice(c)) = self.store[n].side.as_deref_mut() {
            c.scores = scores;
        }
        let epoch = self.update.epoch;
        let node = &mut self.store[n];
        node.flags &= !TARGET;
        if changed {
            let value = Value::from_elements(xs.iter().map(Value::from_datum).collect());
            if !value.same(&node.value) {
                node.value = value;
                node.changed = epoch;
            }
        }
        Ok(())
    }

    /// Removes a choice that nothing depends on from the score and the register.
    pub(crate) fn retire_choice(&mut self, code: &Code, n: NodeId) {
        self.update.vanished += 1;
        if self.store[n].flags & IMPROPER != 0 {
            // It cannot be drawn again: the update is irreversible and has zero weight.
            self.score.drawn.add(f64::INFINITY);
        }
        let hash = self.choice_hash(code, n);
        if let Some(stored) = self.stored(n) {
            self.update.removed.push((n, hash, stored));
        }
        match self.store[n].side.as_deref() {
            Some(Side::Choice(c)) if c.elements != NONE => {
                let scores = c.scores.clone();
                let before = self.update.journal().iter().find_map(|e| match e {
                    Entry::Choice(m, side) if *m == n => Some(side.scores.clone()),
                    _ => None,
                });
                let before =
                    before.filter(|b| b.len() == scores.len()).unwrap_or_else(|| scores.clone());
                for (i, (s, before)) in scores.into_iter().zip(before).enumerate() {
                    self.score.prior.sub(s);
                    self.score.undrawn.add(if self.update.redrawn.contains(&(n, i as u32)) {
                        s
                    } else {
                        before
                    });
                }
            }
            _ => {
                let score = self.store[n].score;
                self.score.prior.sub(score);
                self.update.retired.push((n, score));
            }
        }
        self.choices.unregister(&mut self.update, n, hash);
    }

    fn not_gaussian(&self, code: &Code, n: NodeId) -> Failure {
        let message = "this choice has no Gaussian prior".to_owned();
        self.fail(
            code,
            n,
            FaultKind::Type,
            message,
            Some("elliptical moves need normal, mv_normal or gp".into()),
        )
    }
}

/// Returns element `i` of a drawn array.
fn element(d: &Datum, i: usize) -> Option<Datum> {
    match d {
        Datum::Vec(xs) => xs.get(i).map(|x| Datum::Num(*x)),
        Datum::List(xs) => xs.get(i).cloned(),
        _ => None,
    }
}

/// Returns the hash of the address of element `i`.
pub(crate) fn element_hash(hash: u64, i: usize) -> u64 {
    Key::Num((i as f64).to_bits()).hash_into(hash)
}

impl Constraint {
    /// Returns the constraint in the stored form of a distribution; `None` if it does not
    /// fit.
    fn whole(&self, dist: &Dist) -> Option<Datum> {
        match self {
            Constraint::Stored(d) => Some(d.clone()),
            Constraint::Value(d) if dist.is_stored_whitened() => dist.to_noncentred(d),
            Constraint::Value(d) => Some(d.clone()),
        }
    }
}
