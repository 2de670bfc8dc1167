//! Random choices: drawn when first needed, and absorbing or changed after that.

use crate::lang::code::{DistSpec, Operand};
use crate::lang::error::FaultKind;
use crate::lang::key::Key;
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;
use crate::trace::propose::{Change, Constraint};
use crate::trace::update::{Failure, Step};
use pcadlang_numerics::dist::{Datum, Dist};
use smallvec::SmallVec;

impl Graph {
    pub(super) fn evaluate_draw(
        &mut self,
        n: NodeId,
        spec: &DistSpec,
        site: SiteId,
        keys: &[Operand],
    ) -> Step {
        let frame = self.store[n].frame;
        let mut deps = Deps::new();
        let dist = match self.dist_now(n, spec, &mut deps) {
            Ok(dist) => dist?,
            Err(m) => return self.need(m),
        };
        if let Some(step) = self.await_all(frame, keys)? {
            return Ok(step);
        }
        let stale = self.store[n].flags & WAS_STALE != 0;
        let own = match keys {
            [] => None,
            _ if stale && !self.any_changed(frame, keys) => self.own_hash(n),
            _ => Some(self.own_keyed(n, frame, site, keys)?),
        };
        if stale {
            let moved = own.is_some_and(|h| self.choice_hash(n) != h);
            if !moved && self.update_choice(n, &dist)? {
                self.set_deps(n, deps);
                return Ok(self.finish_unchanged(n));
            }
            // Invalidation stops at plain numbers, so the users of this one were not
            // invalidated for a change of its form.
            let was_told = self.store[n].flags & TARGET != 0 || self.may_be_redrawn(n);
            if !moved && !was_told {
                return Err(self.reformed(n));
            }
            self.retire_choice(n);
            if self.store[n].flags & HELD != 0 {
                let mut side: SmallVec<[NodeId; 4]> = SmallVec::new();
                self.each_side_dep(n, |d, _| side.push(d));
                side.iter().for_each(|d| self.release(*d, true));
            }
            self.set_side(n, None);
        }
        let hash = own.unwrap_or_else(|| self.site_hash(frame, site));
        let value = self.draw_fresh(n, &dist, hash, own)?;
        self.set_deps(n, deps);
        let epoch = self.update.epoch;
        let node = &mut self.store[n];
        node.value = value;
        node.changed = epoch;
        node.flags &= !TARGET;
        Ok(self.finish_unchanged(n))
    }

    fn reformed(&self, n: NodeId) -> Failure {
        let message = "the choice is a number, but its parameters became arrays".to_owned();
        let hint = "write two choices, one for each: if c { a ~ normal([0, 1], 1); a } else { b ~ normal(0, 1); b }";
        self.fail(n, FaultKind::Type, message, Some(hint.into()))
    }

    /// True if one of these operands changed in this update.
    fn any_changed(&self, frame: FrameId, operands: &[Operand]) -> bool {
        let changed = |o: &Operand| {
            self.resolve(frame, *o).is_some_and(|d| self.store[d].changed == self.update.epoch)
        };
        operands.iter().any(changed)
    }

    fn own_keyed(
        &self,
        n: NodeId,
        frame: FrameId,
        site: SiteId,
        keys: &[Operand],
    ) -> Result<u64, Failure> {
        let own = self.own_keys(frame, keys);
        if own.len() < keys.len() {
            keys.iter()
                .try_for_each(|k| Key::of(self.value(frame, *k)).map(drop))
                .map_err(|f| self.fault(n, f))?;
        }
        Ok(self.own_keyed_hash(frame, site, &own))
    }

    /// Gives a choice its first value, from the constraints or the prior.
    fn draw_fresh(
        &mut self,
        n: NodeId,
        dist: &Dist,
        hash: u64,
        own: Option<u64>,
    ) -> Result<Value, Failure> {
        self.update.appeared += 1;
        self.set_improper(n, dist);
        let given = self.update.constraints.get(&hash).and_then(|c| c.whole(dist));
        let elements = dist.elements();
        let mut side = ChoiceSide { hash: own, ..ChoiceSide::default() };
        let value = match elements {
            Some(count) => {
                let mut values = Vec::with_capacity(count);
                side.elements = count as u32;
                for i in 0..count {
                    let given = given.as_ref().and_then(|w| element(w, i));
                    let (one, at) = (dist.element(i), element_hash(hash, i));
                    let (x, score) = self.draw_one(n, &one, at, given)?;
                    side.scores.push(score);
                    values.push(Value::from_datum(&x));
                }
                Value::from_elements(values)
            }
            None => {
                let (x, score) = self.draw_one(n, dist, hash, given)?;
                self.store[n].score = score;
                let value = shown(dist, &x);
                side.stored = dist.is_stored_whitened().then_some(x);
                value
            }
        };
        if elements.is_some() || own.is_some() || side.stored.is_some() {
            self.set_side(n, Some(Side::Choice(side)));
        }
        self.choices.register((&self.store, &mut self.update), n, hash, elements, dist);
        Ok(value)
    }

    /// Gives a choice or an element of one its first value, and scores it.
    fn draw_one(
        &mut self,
        n: NodeId,
        dist: &Dist,
        hash: u64,
        given: Option<Datum>,
    ) -> Result<(Datum, f64), Failure> {
        let given =
            given.or_else(|| self.update.constraints.get(&hash).and_then(|c| c.whole(dist)));
        let is_drawn = given.is_none();
        let x = given.map_or_else(|| self.drawn_now(n, dist, hash), Ok)?;
        let score = dist.log_density_stored(&x);
        self.score.add_prior(score, is_drawn);
        Ok((x, score))
    }

    /// Draws from the prior, or in a first run where that is asked for uniformly.
    fn drawn_now(&self, n: NodeId, dist: &Dist, hash: u64) -> Result<Datum, Failure> {
        if dist.is_improper() && !self.update.starting {
            return Err(self.improper(n, dist));
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

    fn improper(&self, n: NodeId, dist: &Dist) -> Failure {
        let message = format!("`{}` is improper, so it cannot be sampled", dist.name());
        // Kernels reject such draws. Here no observation depends on the choice, so that no kernel
        // could move it either.
        let proper = match dist.name() {
            "ordered" => "order numbers of one distribution: ordered(normal(0, 1), 3)",
            _ => "give it a proper prior, such as normal(0, 10)",
        };
        let hint = format!("observe something that depends on it, or {proper}");
        self.fail(n, FaultKind::Domain, message, Some(hint))
    }

    /// Re-scores a choice under its distribution and applies the pending changes. False
    /// if its form no longer fits (number of elements or dimensions); it must then be
    /// resampled.
    fn update_choice(&mut self, n: NodeId, dist: &Dist) -> Result<bool, Failure> {
        if let Some(Side::Choice(c)) = self.store[n].side.as_deref()
            && c.elements != NONE
        {
            if dist.elements() != Some(c.elements as usize) {
                return Ok(false);
            }
            self.set_improper(n, dist);
            self.update_elements(n, dist)?;
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
        let new = match &change {
            None => None,
            Some(change) => match self.changed(n, dist, change, None)? {
                None if matches!(change, Change::White(_)) => {
                    return Err(self.not_gaussian(n));
                }
                None => {
                    let message = "the value does not fit the choice".into();
                    return Err(self.type_error(n, message));
                }
                new => new,
            },
        };
        let stored = new.as_ref().unwrap_or(&old);
        let score = dist.log_density_stored(stored);
        self.score.prior.sub(old_score);
        self.score.prior.add(score);
        if change.is_some_and(|c| c.is_from_prior()) {
            self.score.undrawn.add(old_score);
            self.score.drawn.add(score);
            self.update.redrawn.push((n, NONE));
        }
        self.store[n].score = score;
        self.store[n].flags &= !TARGET;
        if new.is_some() || whitened {
            self.put_value(n, shown(dist, stored));
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
    fn update_elements(&mut self, n: NodeId, dist: &Dist) -> Result<(), Failure> {
        let hash = self.choice_hash(n);
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
        for (element, change) in &changes {
            let range =
                if *element == NONE { 0..count } else { *element as usize..*element as usize + 1 };
            for i in range {
                let (one, at) = (dist.element(i), element_hash(hash, i));
                let change =
                    if *element == NONE { change.of_element(i) } else { Some(change.clone()) };
                let Some(change) = change else { continue };
                let new = self.changed(n, &one, &change, Some(at))?;
                if let (Some(new), Some(x)) = (new, xs.get_mut(i)) {
                    if change.is_from_prior() {
                        self.score.undrawn.add(side.scores[i]);
                        self.score.drawn.add(one.log_density_stored(&new));
                        self.update.redrawn.push((n, i as u32));
                    }
                    *x = new;
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
        self.store[n].flags &= !TARGET;
        if !changes.is_empty() {
            self.put_value(n, Value::from_elements(xs.iter().map(Value::from_datum).collect()));
        }
        Ok(())
    }

    /// Returns the stored form that a choice or an element of one gets by a change; `None` if
    /// the change does not fit it.
    fn changed(
        &mut self,
        n: NodeId,
        dist: &Dist,
        change: &Change,
        hash: Option<u64>,
    ) -> Result<Option<Datum>, Failure> {
        Ok(match change {
            Change::Set(d) => Some(d.clone()),
            Change::Value(d) => dist.to_noncentred(d),
            Change::Resample => {
                let hash = hash.unwrap_or_else(|| self.choice_hash(n));
                Some(self.drawn_now(n, dist, hash)?)
            }
            Change::Free(y) => {
                let support = dist.stored_support();
                if support.free_dim() != y.len() {
                    let message = "the choice changed its dimension".to_owned();
                    return Err(self.fail(n, FaultKind::Domain, message, None));
                }
                let (x, jacobian) = support.from_free(y);
                self.score.jacobian.add(jacobian);
                Some(x)
            }
            Change::White(z) if dist.is_stored_whitened() => Some(Datum::Vec(z.clone().into())),
            Change::White(z) => dist.colour(z),
        })
    }

    /// Gives a node a value, which may be the one that it has.
    fn put_value(&mut self, n: NodeId, value: Value) {
        let node = &mut self.store[n];
        if !value.same(&node.value) {
            node.value = value;
            node.changed = self.update.epoch;
        }
    }

    /// Removes a choice that nothing depends on from the score and the register.
    pub(crate) fn retire_choice(&mut self, n: NodeId) {
        self.update.vanished += 1;
        if self.store[n].flags & IMPROPER != 0 {
            // It cannot be drawn again: the update is irreversible and has zero weight.
            self.score.drawn.add(f64::INFINITY);
        }
        let hash = self.choice_hash(n);
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

    fn not_gaussian(&self, n: NodeId) -> Failure {
        let message = "this choice has no Gaussian prior".to_owned();
        self.fail(
            n,
            FaultKind::Type,
            message,
            Some("elliptical moves need normal, mv_normal or gp".into()),
        )
    }
}

/// Returns the value of a choice in this stored form.
fn shown(dist: &Dist, stored: &Datum) -> Value {
    match dist.is_stored_whitened() {
        true => Value::from_datum(&dist.from_noncentred(stored)),
        false => Value::from_datum(stored),
    }
}

impl Change {
    /// True if the new value is one of the prior.
    fn is_from_prior(&self) -> bool {
        matches!(self, Change::Resample | Change::White(_))
    }

    /// Returns what a change of a whole choice is for its element `i`.
    fn of_element(&self, i: usize) -> Option<Change> {
        Some(match self {
            Change::Set(d) | Change::Value(d) => Change::Set(element(d, i)?),
            Change::White(z) => Change::White(vec![*z.get(i)?]),
            change => change.clone(),
        })
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
