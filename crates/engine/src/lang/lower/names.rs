//! Looking up and binding names, and making sites.

use super::lowerer::{Lowerer, Typed};
use super::scope::{Binding, Body, Meaning, ScopeKind};
use crate::lang::builtins::Type;
use crate::lang::code::{Operand, Site, SiteId, SiteSegment, SiteTag};
use pcadlang_syntax::ast::Name;
use std::sync::Arc;

impl Lowerer<'_> {
    /// Returns a name's meaning, and how many blocks out it is bound.
    pub fn lookup(&self, name: &str) -> Option<(Binding, u16)> {
        for (up, scope) in self.scopes.iter().rev().enumerate() {
            let names = if scope.kind == ScopeKind::Root {
                &self.modules[self.module].names
            } else {
                &scope.names
            };
            if let Some(b) = names.get(name) {
                return Some((*b, up as u16));
            }
        }
        None
    }

    /// Returns an operand as seen from `up` blocks further in.
    pub fn reach(o: Operand, up: u16) -> Operand {
        match o {
            Operand::Local(slot) if up > 0 => Operand::Outer { up, slot },
            // Another name for an operand still further out.
            Operand::Outer { up: further, slot } => Operand::Outer { up: further + up, slot },
            o => o,
        }
    }

    /// Returns every name visible here, for hints.
    pub fn visible(&self) -> Vec<Arc<str>> {
        let mut names: Vec<Arc<str>> =
            self.scopes.iter().flat_map(|s| s.names.keys().cloned()).collect();
        let module = &self.modules[self.module];
        names.extend(module.names.keys().cloned());
        names.extend(module.namespaces.keys().cloned());
        names
    }

    /// Binds a name in the innermost block.
    pub fn bind(&mut self, name: &Name, meaning: Meaning, ty: Type) {
        let binding = Binding { meaning, ty, span: name.span };
        let at_root = self.scopes.last().is_none_or(|s| s.kind == ScopeKind::Root);
        let names = if at_root {
            &mut self.modules[self.module].names
        } else {
            match self.scopes.last_mut() {
                Some(s) => &mut s.names,
                None => return,
            }
        };
        if let Some(old) = names.insert(Arc::clone(&name.node), binding) {
            let e = self.error(
                format!("`{}` is bound twice", name.node),
                name.span,
                "bound again here",
            );
            e.point_at(old.span, "first bound here");
            e.hint_also("rename one of them");
        }
    }

    /// Binds a value in the innermost block; at the top level it is also visible in the
    /// inference blocks.
    pub fn bind_value(&mut self, name: &Name, value: Typed) {
        self.bind(name, Meaning::Value(value.at), value.ty);
        if self.scopes.len() == 1 {
            let global = self.global_name(name);
            self.code.globals.insert(global, value.at);
        }
    }

    fn body(&mut self) -> &mut Body {
        if self.bodies.is_empty() {
            self.bodies.push(Body::default());
        }
        let last = self.bodies.len() - 1;
        &mut self.bodies[last]
    }

    /// Lowers something below the name of a binding.
    pub fn below<T>(&mut self, name: &Arc<str>, f: impl FnOnce(&mut Self) -> T) -> T {
        self.note_root(name);
        self.body().prefix.push(Arc::clone(name));
        let result = f(self);
        self.body().prefix.pop();
        result
    }

    /// Records a name that addresses may begin with.
    fn note_root(&mut self, name: &Arc<str>) {
        if self.bodies.len() == 1 && self.body().prefix.is_empty() {
            self.roots.insert(Arc::clone(name));
        }
    }

    /// Creates a site below the current bindings.
    pub fn site(&mut self, name: &Arc<str>, own_tags: Vec<SiteTag>, carried: u32) -> SiteId {
        let occurrence = self.next_occurrence(name);
        self.site_of(name, occurrence, own_tags, carried)
    }

    /// Counts one more occurrence of a name below the current bindings, and returns the
    /// count.
    pub fn next_occurrence(&mut self, name: &Arc<str>) -> u32 {
        let body = self.body();
        let count = body.counts.entry((body.prefix.clone(), Arc::clone(name))).or_insert(0);
        *count += 1;
        *count
    }

    /// Creates a site below the current bindings, for a given occurrence of its name.
    pub fn site_of(
        &mut self,
        name: &Arc<str>,
        occurrence: u32,
        own_tags: Vec<SiteTag>,
        carried: u32,
    ) -> SiteId {
        let module = self.modules[self.module].prefix.clone();
        if self.bodies.len() == 1
            && let Some(m) = &module
        {
            self.roots.insert(Arc::clone(m));
        } else {
            self.note_root(name);
        }
        let in_function = self.bodies.len() > 1;
        let body = self.body();
        let outer = module.into_iter().filter(|_| !in_function);
        let mut segments: Vec<SiteSegment> =
            outer.chain(body.prefix.iter().cloned()).map(|s| SiteSegment::new(s, 1)).collect();
        segments.push(SiteSegment::new(Arc::clone(name), occurrence));
        let tags = body.tags.iter().cloned().chain(own_tags).collect();
        self.code.sites.push(Site { segments: segments.into(), carried, tags });
        SiteId::new(self.code.sites.len() - 1)
    }

    /// Returns the index of a tag's name.
    pub fn tag_index(&mut self, name: &Arc<str>) -> u32 {
        if let Some(i) = self.code.tags.iter().position(|t| t == name) {
            return i as u32;
        }
        self.code.tags.push(Arc::clone(name));
        self.code.tags.len() as u32 - 1
    }

    /// Lowers with `f` under the tags of an enclosing `assume`.
    pub fn with_tags<T>(&mut self, tags: Vec<SiteTag>, f: impl FnOnce(&mut Self) -> T) -> T {
        let depth = self.body().tags.len();
        self.body().tags.extend(tags);
        let result = f(self);
        self.body().tags.truncate(depth);
        result
    }

    /// Returns the loops of the current function around the innermost block, outermost
    /// first, by index into scopes.
    pub fn loops_here(&self) -> Vec<usize> {
        let mut loops = Vec::new();
        for (i, s) in self.scopes.iter().enumerate().rev() {
            match s.kind {
                ScopeKind::Loop { .. } => loops.push(i),
                ScopeKind::Branch => {}
                _ => break,
            }
        }
        loops.reverse();
        loops
    }
}
