//! Keyed containers, indexing, and reading a container as a whole.

use crate::lang::code::{Code, ElementDraw, ElementKey, Op, Operand};
use crate::lang::error::FaultKind;
use crate::lang::key::Key;
use crate::lang::value::Value;
use crate::trace::graph::Graph;
use crate::trace::node::*;
use crate::trace::update::{Failure, Poll, Step};
use indexmap::IndexMap;
use smallvec::{SmallVec, smallvec};
use std::sync::Arc;

/// The location of an element's value.
enum Place {
    Node(NodeId),
    Constant(Operand),
}

/// The outcome of a search for an element.
enum Found {
    Place(Place),
    Missing,
    Pending(Poll),
}

impl Graph {
    /// Determines the keys of a container and the draws of its elements.
    pub(super) fn evaluate_container(&mut self, n: NodeId, sources: &[ElementDraw]) -> Step {
        let frame = self.store[n].frame;
        let mut deps = Deps::new();
        let entries = if let [ElementDraw { loops, keys, .. }] = sources
            && let ([slot], [ElementKey::Loop(0)]) = (&loops[..], &keys[..])
        {
            let outer = self.store[frame].base + *slot;
            if self.store[outer].state != State::Clean {
                return self.need(outer);
            }
            deps.push(outer);
            None
        } else {
            let mut entries = IndexMap::new();
            for (i, source) in sources.iter().enumerate() {
                let mut passes = SmallVec::new();
                if let Some(step) =
                    self.walk(n, frame, source, i as u32, &mut passes, &mut deps, &mut entries)?
                {
                    return Ok(step);
                }
            }
            Some(Arc::new(entries))
        };
        let structure_changed = deps.iter().any(|d| self.store[*d].changed == self.update.epoch);
        let keep = self.store[n].flags & WAS_STALE != 0 && !structure_changed;
        let held = self.store[n].flags & HELD != 0;
        if held {
            deps.iter().for_each(|d| self.acquire(*d, n, true));
        }
        self.let_side_go(n);
        self.set_side(n, Some(Side::Table(Table { deps, entries })));
        if keep {
            return Ok(self.finish_unchanged(n));
        }
        let made = self.store.new_version(n);
        Ok(self.finish(n, Value::Container(made)))
    }

    /// Walks the loops of a source and adds each key.
    #[allow(clippy::too_many_arguments)]
    fn walk(
        &mut self,
        n: NodeId,
        frame: FrameId,
        source: &ElementDraw,
        index: u32,
        passes: &mut SmallVec<[u32; 2]>,
        deps: &mut Deps,
        entries: &mut IndexMap<SmallVec<[Key; 1]>, Element>,
    ) -> Result<Option<Poll>, Failure> {
        if let Some(slot) = source.loops.get(passes.len()) {
            let node = self.store[frame].base + *slot;
            if self.store[node].state != State::Clean {
                return self.need(node).map(Some);
            }
            deps.push(node);
            let count = self.loop_of(node).map_or(0, |l| l.frames.len());
            for i in 0..count {
                let inner = self.pass_frame(node, i)?;
                passes.push(i as u32);
                let step = self.walk(n, inner, source, index, passes, deps, entries)?;
                passes.pop();
                if step.is_some() {
                    return Ok(step);
                }
            }
            return Ok(None);
        }
        let mut keys: SmallVec<[Key; 1]> = SmallVec::new();
        for k in &source.keys {
            let key = match k {
                ElementKey::Loop(level) => {
                    let mut f = frame;
                    for _ in *level as usize + 1..source.loops.len() {
                        f = self.store[self.store[f].owner].frame;
                    }
                    let key = self.store[f].key.clone();
                    key.ok_or_else(|| {
                        self.type_error(n, "this iteration of the loop has no key".into())
                    })?
                }
                ElementKey::Operand(o) => {
                    if let Some(m) = self.unready(frame, *o) {
                        return self.need(m).map(Some);
                    }
                    deps.extend(self.resolve(frame, *o));
                    Key::of(self.value(frame, *o)).map_err(|f| self.fault(n, f))?
                }
            };
            keys.push(key);
        }
        let element = Element { source: index, passes: passes.clone() };
        if entries.insert(keys.clone(), element).is_some() {
            let shown = keys.iter().map(|k| format!("[{k}]")).collect::<String>();
            let Op::Container { name, .. } = self.op(n) else { return Ok(None) };
            let message = format!("`{name}{shown}` is drawn twice");
            let hint = "every iteration of the loop needs its own key".to_owned();
            return Err(self.fail(n, FaultKind::Duplicate, message, Some(hint)));
        }
        Ok(None)
    }

    /// Finds the element of a container for a key.
    fn find(&mut self, code: &Code, container: NodeId, keys: &[Key]) -> Result<Found, Failure> {
        match self.store[container].side.as_deref() {
            Some(Side::Loop(l)) => {
                let [key] = keys else { return Ok(Found::Missing) };
                // Results of a map over names can be indexed by name and by position.
                let pass =
                    l.keys.find(key).or_else(|| key.as_index().filter(|i| *i < l.keys.len()));
                let Some(pass) = pass else { return Ok(Found::Missing) };
                self.map_result(container, pass).map(Found::Place)
            }
            Some(Side::Table(Table { entries: None, .. })) => {
                let Op::Container { sources, .. } = self.op(container) else {
                    return Ok(Found::Missing);
                };
                let ([key], source) = (keys, &sources[0]) else { return Ok(Found::Missing) };
                let outer = self.store[self.store[container].frame].base + source.loops[0];
                let draw = source.draw;
                let pass = self.loop_of(outer).and_then(|l| l.keys.find(key));
                let Some(pass) = pass else { return Ok(Found::Missing) };
                let f = self.pass_frame(outer, pass)?;
                Ok(Found::Place(Place::Node(self.store[f].base + draw)))
            }
            Some(Side::Table(Table { entries: Some(entries), .. })) => {
                let Some(element) = entries.get(keys).cloned() else { return Ok(Found::Missing) };
                self.element_node(code, container, &element).map(|n| Found::Place(Place::Node(n)))
            }
            _ => self.need(container).map(Found::Pending),
        }
    }

    /// Returns the draw of an element.
    fn element_node(
        &mut self,
        code: &Code,
        container: NodeId,
        element: &Element,
    ) -> Result<NodeId, Failure> {
        let Op::Container { sources, .. } = &code.ops[self.store[container].op] else {
            return Ok(container);
        };
        let source = &sources[element.source as usize];
        let mut frame = self.store[container].frame;
        for (slot, pass) in source.loops.iter().zip(&element.passes) {
            let outer = self.store[frame].base + *slot;
            frame = self.pass_frame(outer, *pass as usize)?;
        }
        Ok(self.store[frame].base + source.draw)
    }

    /// Returns the location of the result of a pass of a `map`.
    fn map_result(&mut self, owner: NodeId, pass: usize) -> Result<Place, Failure> {
        let f = self.pass_frame(owner, pass)?;
        let result = self.code.blocks[self.store[f].block].result;
        Ok(match result {
            Some(o) => self.resolve(f, o).map_or(Place::Constant(o), Place::Node),
            None => Place::Constant(Operand::Const(0)),
        })
    }

    /// Reads all elements of the container in the preceding slot.
    pub(super) fn evaluate_gather(&mut self, code: &Code, n: NodeId) -> Step {
        let container = n.container();
        if self.store[container].state != State::Clean {
            return self.need(container);
        }
        let mut places: Vec<(Option<Key>, Place)> = Vec::new();
        match self.store[container].side.as_deref() {
            Some(Side::Loop(l)) => {
                let keys = l.keys.clone();
                let named = matches!(&keys, Keys::Listed { keys, .. } if keys.iter().all(|k| matches!(k, Key::Str(_))));
                for i in 0..keys.len() {
                    places.push((named.then(|| keys.get(i)), self.map_result(container, i)?));
                }
            }
            Some(Side::Table(t)) => {
                let entries = match &t.entries {
                    Some(e) => Arc::clone(e),
                    None => Arc::new(self.single_loop_entries(container)),
                };
                let mut sorted: Vec<_> = entries.iter().collect();
                let names = sorted.iter().all(|(k, _)| matches!(k.last(), Some(Key::Str(_))));
                if !names {
                    sorted.sort_by(|(a, _), (b, _)| compare_keys(a, b));
                }
                for (keys, element) in sorted {
                    let node = self.element_node(code, container, element)?;
                    places.push((keys.last().filter(|_| names).cloned(), Place::Node(node)));
                }
            }
            _ => {}
        }
        let mut waiting = false;
        let mut deps: Deps = smallvec![];
        for (_, p) in &places {
            let Place::Node(m) = p else { continue };
            match self.store[*m].state {
                State::Clean => {}
                _ => {
                    self.need(*m)?;
                    waiting = true;
                }
            }
            deps.push(*m);
        }
        if waiting {
            return Ok(Poll::Pending);
        }
        let mut values = Vec::with_capacity(places.len());
        let mut nested: Deps = smallvec![];
        for (_, p) in &places {
            let v = match p {
                Place::Node(m) => &self.store[*m].value,
                Place::Constant(Operand::Const(i)) => self.code.const_value(*i),
                Place::Constant(_) => &Value::Unit,
            };
            if let Value::Container(r) = v {
                nested.push(r.node.gather());
            }
            values.push(v.clone());
        }
        for m in &nested {
            if self.store[*m].state != State::Clean {
                return self.need(*m);
            }
        }
        for v in &mut values {
            if let Value::Container(r) = v {
                *v = self.store[r.node.gather()].value.clone();
            }
        }
        deps.extend(nested);
        let value = match places.first() {
            Some((Some(_), _)) => {
                let names = places.iter().map(|(k, _)| match k {
                    Some(Key::Str(s)) => Arc::clone(s),
                    Some(k) => Arc::from(k.to_string()),
                    None => Arc::from(""),
                });
                Value::Record(Arc::new(names.zip(values).collect()))
            }
            _ => Value::from_elements(values),
        };
        self.set_deps(n, deps);
        self.finish_made(n, value)
    }

    /// Returns the entries of a container whose keys are those of its single loop.
    fn single_loop_entries(&self, container: NodeId) -> IndexMap<SmallVec<[Key; 1]>, Element> {
        let Op::Container { sources, .. } = self.op(container) else {
            return IndexMap::new();
        };
        let outer = self.store[self.store[container].frame].base + sources[0].loops[0];
        match self.store[outer].side.as_deref() {
            Some(Side::Loop(l)) => (0..l.keys.len())
                .map(|i| {
                    (smallvec![l.keys.get(i)], Element { source: 0, passes: smallvec![i as u32] })
                })
                .collect(),
            _ => IndexMap::new(),
        }
    }

    pub(super) fn evaluate_index(
        &mut self,
        code: &Code,
        n: NodeId,
        base: Operand,
        keys: &[Operand],
    ) -> Step {
        let frame = self.store[n].frame;
        if let Some(step) = self.await_all(frame, &[base])? {
            return Ok(step);
        }
        let mut deps = Deps::new();
        if let ([key], false) = (keys, matches!(self.value(frame, base), Value::Container(_))) {
            let found = match self.input(frame, *key, &mut deps) {
                Ok(key) => index_value(self.value(frame, base), key),
                Err(m) => return self.need(m),
            };
            let value = found.map_err(|f| self.fault(n, f))?;
            self.set_deps(n, deps);
            return Ok(self.finish(n, value));
        }
        let mut rest: SmallVec<[Value; 2]> = SmallVec::new();
        let read = self.inputs(frame, keys, &mut deps);
        if let Err(m) = read.map(|values| values.iter().for_each(|v| rest.push(Value::clone(v)))) {
            return self.need(m);
        }
        if let Some(m) = self.element_read_before(n, base, keys) {
            if self.store[m].state != State::Clean {
                return self.need(m);
            }
            let value = self.store[m].value.clone();
            return Ok(self.finish(n, value));
        }
        let mut value = self.value(frame, base).clone();
        while !rest.is_empty() {
            if let Value::Container(r) = value {
                let container = r.node;
                if self.store[container].state != State::Clean {
                    return self.need(container);
                }
                if matches!(rest[0], Value::Array(_) | Value::List(_)) {
                    // Several elements at once: read the container as a whole.
                    if self.store[container.gather()].state != State::Clean {
                        return self.need(container.gather());
                    }
                    deps.push(container.gather());
                    value = self.store[container.gather()].value.clone();
                    continue;
                }
                let width = self.key_width(container).min(rest.len());
                let found: Option<SmallVec<[Key; 2]>> =
                    rest[..width].iter().map(Key::from_value).collect();
                let Some(found) = found else {
                    let message = format!("{} cannot be a key", rest[0].type_name());
                    return Err(self.type_error(n, message));
                };
                let place = match self.find(code, container, &found)? {
                    Found::Place(p) => p,
                    Found::Pending(step) => return Ok(step),
                    Found::Missing => return Err(self.missing(n, container, &found)),
                };
                value = match place {
                    Place::Constant(Operand::Const(i)) => self.code.const_value(i).clone(),
                    Place::Constant(_) => Value::Unit,
                    Place::Node(m) => {
                        if self.store[m].state != State::Clean {
                            return self.need(m);
                        }
                        deps.push(m);
                        self.store[m].value.clone()
                    }
                };
                rest.drain(..width);
            } else {
                let key = rest.remove(0);
                value = match index_value(&value, &key) {
                    Ok(v) => v,
                    Err(f) => return Err(self.fault(n, f)),
                };
            }
        }
        self.set_deps(n, deps);
        Ok(self.finish(n, value))
    }

    /// Returns the element of a container that a node read before, if container and keys
    /// are unchanged.
    fn element_read_before(&self, n: NodeId, base: Operand, keys: &[Operand]) -> Option<NodeId> {
        let node = &self.store[n];
        let Value::Container(r) = self.value(node.frame, base) else { return None };
        let Some(Side::Deps(deps)) = node.side.as_deref() else { return None };
        let as_it_was = |d: NodeId| {
            let d = &self.store[d];
            d.state == State::Clean && d.changed != self.update.epoch
        };
        let all = keys.iter().chain([&base]).filter_map(|o| self.resolve(node.frame, *o));
        let same =
            node.flags & WAS_STALE != 0 && as_it_was(r.node) && all.into_iter().all(as_it_was);
        (same && deps.len() == 1 && deps[0] != r.node.gather()).then(|| deps[0])
    }

    fn missing(&self, n: NodeId, container: NodeId, keys: &[Key]) -> Failure {
        let shown = keys.iter().map(|k| format!("[{k}]")).collect::<String>();
        let known: Vec<String> = match self.store[container].side.as_deref() {
            Some(Side::Loop(l)) => {
                (0..l.keys.len().min(100)).map(|i| l.keys.get(i).to_string()).collect()
            }
            Some(Side::Table(Table { entries: Some(e), .. })) => e
                .keys()
                .take(100)
                .map(|k| k.iter().map(Key::to_string).collect::<Vec<_>>().join("]["))
                .collect(),
            _ => {
                let entries = self.single_loop_entries(container);
                entries
                    .keys()
                    .take(100)
                    .map(|k| k.iter().map(Key::to_string).collect::<String>())
                    .collect()
            }
        };
        let wanted = keys.iter().map(Key::to_string).collect::<Vec<_>>().join("][");
        let hint = match pcadlang_syntax::diag::nearest(&wanted, known.iter().map(String::as_str)) {
            Some(near) => Some(format!("did you mean [{near}]?")),
            None => match (known.first(), known.last()) {
                (Some(a), Some(b)) if known.len() > 1 => {
                    Some(format!("its keys run from [{a}] to [{b}]"))
                }
                (Some(a), _) => Some(format!("its only key is [{a}]")),
                _ => Some("it has no elements".into()),
            },
        };
        let what = match self.op(container) {
            Op::Container { name, .. } => format!("`{name}`"),
            _ => "the result of this map".into(),
        };
        self.fail(n, FaultKind::Index, format!("{what} has no element {shown}"), hint)
    }
}

/// Compares keys: numbers numerically and before all other kinds, the rest by their
/// `Ord`.
fn compare_keys(a: &[Key], b: &[Key]) -> std::cmp::Ordering {
    for (x, y) in a.iter().zip(b) {
        let order = match (x, y) {
            (Key::Num(x), Key::Num(y)) => f64::from_bits(*x).total_cmp(&f64::from_bits(*y)),
            _ => x.cmp(y),
        };
        if order.is_ne() {
            return order;
        }
    }
    a.len().cmp(&b.len())
}

use crate::lang::index::index_value;
