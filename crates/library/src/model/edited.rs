//! Programs derived from other programs: with a new text, additional items or a query;
//! and the plans of a model by name. Used where programs are edited step by step.

use super::program::Files;
use super::{Error, Model, Program};
use pcadlang_engine::lang::plan::{DeclaredKernel, Plan};
use pcadlang_syntax::ast::{Item, ItemKind, Stmt, StmtKind};
use pcadlang_syntax::diag::IntoDiagnostic;
use pcadlang_syntax::span::FileId;
use pcadlang_syntax::{SyntaxError, parse, parse_expr};
use std::sync::Arc;

impl Program {
    /// Returns the same program with another text. It keeps its parameters and data, and
    /// the data files that have been read.
    ///
    /// # Errors
    /// As [`Program::open`].
    pub fn edited(&self, text: &str) -> Result<Program, Error> {
        let new = Program::read(&self.name, text, self.reach.clone())?;
        let (loaded, sources, text) = (new.loaded, new.sources, new.text);
        Ok(Program { loaded, sources, text, ..self.clone() })
    }

    /// Returns the same program with more items at its end. They are parsed from a
    /// separate text, which must not include files.
    ///
    /// # Errors
    /// If the text does not parse.
    pub fn and(&self, name: &str, text: &str) -> Result<Program, Error> {
        self.with_items(name, text, |text, file| match parse(text, file) {
            (program, errors) if errors.is_empty() => Ok(program.items),
            (_, errors) => Err(errors),
        })
    }

    /// Returns the same program with `sample e;` at its end, where `e` is an expression
    /// parsed from a separate text. Its value is the last of
    /// [`Code::samples`](pcadlang_engine::lang::code::Code::samples).
    ///
    /// # Errors
    /// If the text is not an expression.
    pub fn with_query(&self, name: &str, text: &str) -> Result<Program, Error> {
        self.with_items(name, text, |text, file| {
            let expr = parse_expr(text, file)?;
            let span = expr.span;
            let stmt = Stmt { kind: StmtKind::Sample(expr), span };
            Ok(vec![Item { kind: ItemKind::Stmt(stmt), span }])
        })
    }

    fn with_items(
        &self,
        name: &str,
        text: &str,
        items: impl Fn(&str, FileId) -> Result<Vec<Item>, Vec<SyntaxError>>,
    ) -> Result<Program, Error> {
        let mut more = self.clone();
        let file = more.sources.add(name, text);
        match items(text, file) {
            Ok(items) => {
                if let Some(main) = more.loaded.units.first_mut() {
                    main.includes.resize(main.includes.len() + items.len(), None);
                    main.program.items.extend(items);
                }
                Ok(more)
            }
            Err(errors) => {
                let diagnostics = errors.into_iter().map(IntoDiagnostic::into_diagnostic).collect();
                Err(Error { diagnostics, sources: more.sources })
            }
        }
    }

    /// Returns the same program as if it had been loaded from this path: included and
    /// read files are resolved relative to it.
    ///
    /// # Errors
    /// If it cannot be loaded from there.
    pub fn written_as(&self, path: &str) -> Result<Program, Error> {
        Program { name: path.to_owned(), reach: self.reach.of(path), ..self.clone() }
            .edited(&self.text)
    }

    /// Loads another program with the parameters and data of this one that it declares.
    ///
    /// # Errors
    /// As [`Program::open`].
    pub fn replaced(&self, path: &str) -> Result<Program, Error> {
        let new = Program::open_within(path, self.reach.of(path))?;
        let interface = new.interface();
        let mut new = Program {
            loaded: new.loaded,
            sources: new.sources,
            name: new.name,
            text: new.text,
            reach: new.reach,
            ..self.clone()
        };
        new.sets.retain(|(name, _)| interface.params.iter().any(|p| p.name == *name));
        new.data.retain(|name, _| interface.data.iter().any(|d| d.name == *name));
        // Files may have changed.
        new.files = Files::default();
        Ok(new)
    }
}

impl Model {
    /// Returns the names of the `infer` blocks that have one.
    pub fn plan_names(&self) -> impl Iterator<Item = &str> {
        self.compiled.plans.iter().filter_map(|p| p.name.as_deref())
    }

    /// Returns the `infer` block with this name.
    pub fn plan_named(&self, name: &str) -> Option<Arc<Plan>> {
        self.compiled.plans.iter().find(|p| p.name.as_deref() == Some(name)).cloned()
    }

    /// Returns the last `infer` block.
    pub fn last_plan(&self) -> Option<Arc<Plan>> {
        self.compiled.plans.last().cloned()
    }

    /// Returns the kernels that the program declares.
    pub fn kernels(&self) -> &[DeclaredKernel] {
        &self.compiled.kernels
    }
}
