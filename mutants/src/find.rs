//! Finds the places where an error can be made, and selects some of them.

use crate::{Failure, within};
use proc_macro2::Span;
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr, Lit, Stmt, UnOp};

/// A mutant: an expression in which some ranges are replaced.
#[derive(Clone, Debug)]
pub struct Mutant {
    pub file: PathBuf,
    pub line: usize,
    /// File, function, text and change, which identify the mutant.
    pub key: String,
    /// The range of the expression, in bytes of the file.
    pub range: Range<usize>,
    pub replaced: Vec<(Range<usize>, String)>,
}

/// Selects mutants of these folders, in proportion to the number of places in each, but
/// at least forty.
pub fn select(root: &Path, folders: &[&str], count: usize) -> Result<Vec<Mutant>, Failure> {
    let mut by_folder = Vec::new();
    for folder in folders {
        let mut all = Vec::new();
        for file in files(&root.join(folder))? {
            of_file(root, &file, &mut all)?;
        }
        all.sort_by_key(|(order, _)| *order);
        by_folder.push(all);
    }
    let total: usize = by_folder.iter().map(Vec::len).sum();
    let share = |n: usize| (count * n / total.max(1)).max(40);
    let mut chosen: Vec<Mutant> = by_folder
        .into_iter()
        .flat_map(|all| {
            let n = share(all.len());
            all.into_iter().take(n)
        })
        .map(|(_, m)| m)
        .collect();
    chosen.sort_by(|a, b| (&a.file, a.range.start, &a.key).cmp(&(&b.file, b.range.start, &b.key)));
    Ok(chosen)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    if !folder.exists() {
        return Ok(vec![folder.with_extension("rs")].into_iter().filter(|f| f.exists()).collect());
    }
    let (mut all, mut open) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "tests" {
                    open.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "rs")
                && !name.ends_with("tests")
                && name != "testing"
            {
                all.push(path);
            }
        }
    }
    all.sort();
    Ok(all)
}

fn of_file(root: &Path, file: &Path, into: &mut Vec<(u64, Mutant)>) -> Result<(), Failure> {
    let text = std::fs::read_to_string(file)?;
    let syntax = syn::parse_file(&text).map_err(|e| format!("{}: {e}", file.display()))?;
    let mut finder = Finder {
        file,
        name: within(root, file),
        text: &text,
        function: String::new(),
        seen: HashMap::new(),
        into,
    };
    finder.visit_file(&syntax);
    Ok(())
}

struct Finder<'a> {
    file: &'a Path,
    name: String,
    text: &'a str,
    function: String,
    seen: HashMap<String, usize>,
    into: &'a mut Vec<(u64, Mutant)>,
}

/// Computes FNV-1a and mixes the bits; the result is the same on any machine.
fn hash(text: &str) -> u64 {
    let h = text
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
    let h = (h ^ (h >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    h ^ (h >> 33)
}

impl Finder<'_> {
    /// Adds a mutant. `seldom` divides its chance of being selected.
    fn add(
        &mut self,
        whole: Span,
        change: &str,
        replaced: Vec<(Range<usize>, String)>,
        seldom: u64,
    ) {
        let range = whole.byte_range();
        let snippet: String =
            self.text[range.clone()].split_whitespace().collect::<Vec<_>>().join(" ");
        let snippet: String = snippet.chars().take(70).collect();
        let base = format!("{} {}: `{snippet}`: {change}", self.name, self.function);
        let n = self.seen.entry(base.clone()).or_default();
        *n += 1;
        let key = if *n == 1 { base } else { format!("{base} ({n})") };
        let order = (hash(&key) / 8).saturating_mul(seldom);
        let line = whole.start().line;
        self.into
            .push((order, Mutant { file: self.file.to_path_buf(), line, key, range, replaced }));
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| match &a.meta {
        syn::Meta::List(l) => a.path().is_ident("cfg") && l.tokens.to_string().contains("test"),
        m => m.path().is_ident("test"),
    })
}

fn other(op: &BinOp) -> Option<&'static str> {
    Some(match op {
        BinOp::Add(_) => "-",
        BinOp::Sub(_) => "+",
        BinOp::Mul(_) => "/",
        BinOp::Div(_) => "*",
        BinOp::Lt(_) => "<=",
        BinOp::Le(_) => "<",
        BinOp::Gt(_) => ">=",
        BinOp::Ge(_) => ">",
        BinOp::Eq(_) => "!=",
        BinOp::Ne(_) => "==",
        BinOp::And(_) => "||",
        BinOp::Or(_) => "&&",
        BinOp::AddAssign(_) => "-=",
        BinOp::SubAssign(_) => "+=",
        BinOp::MulAssign(_) => "/=",
        BinOp::DivAssign(_) => "*=",
        _ => return None,
    })
}

/// Returns whether a condition binds names.
fn binds(e: &Expr) -> bool {
    match e {
        Expr::Let(_) => true,
        Expr::Binary(b) => binds(&b.left) || binds(&b.right),
        Expr::Paren(p) => binds(&p.expr),
        _ => false,
    }
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_item_mod(&mut self, m: &'ast syn::ItemMod) {
        if !is_test(&m.attrs) {
            visit::visit_item_mod(self, m);
        }
    }

    fn visit_item_fn(&mut self, f: &'ast syn::ItemFn) {
        if f.sig.constness.is_none() && !is_test(&f.attrs) {
            self.function = f.sig.ident.to_string();
            visit::visit_block(self, &f.block);
        }
    }

    fn visit_impl_item_fn(&mut self, f: &'ast syn::ImplItemFn) {
        // Debug output is not worth a test.
        if f.sig.constness.is_none() && f.sig.ident != "fmt" {
            self.function = f.sig.ident.to_string();
            visit::visit_block(self, &f.block);
        }
    }

    fn visit_item_const(&mut self, _: &'ast syn::ItemConst) {}
    fn visit_item_static(&mut self, _: &'ast syn::ItemStatic) {}
    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}
    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}
    fn visit_item_enum(&mut self, _: &'ast syn::ItemEnum) {}
    fn visit_attribute(&mut self, _: &'ast syn::Attribute) {}
    fn visit_type(&mut self, _: &'ast syn::Type) {}
    fn visit_pat(&mut self, _: &'ast syn::Pat) {}
    fn visit_macro(&mut self, _: &'ast syn::Macro) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}

    fn visit_expr_repeat(&mut self, e: &'ast syn::ExprRepeat) {
        self.visit_expr(&e.expr);
    }

    fn visit_expr_binary(&mut self, e: &'ast syn::ExprBinary) {
        let logical = matches!(e.op, BinOp::And(_) | BinOp::Or(_));
        if let Some(other) = other(&e.op)
            && !(logical && (binds(&e.left) || binds(&e.right)))
        {
            let op = e.op.span().byte_range();
            let change = format!("{} to {other}", &self.text[op.clone()]);
            self.add(e.span(), &change, vec![(op, other.into())], 1);
        }
        visit::visit_expr_binary(self, e);
    }

    fn visit_expr_unary(&mut self, e: &'ast syn::ExprUnary) {
        if matches!(e.op, UnOp::Not(_) | UnOp::Neg(_)) && !matches!(&*e.expr, Expr::Lit(_)) {
            let op = e.op.span().byte_range();
            let change = format!("without {}", &self.text[op.clone()]);
            self.add(e.span(), &change, vec![(op, String::new())], 1);
        }
        visit::visit_expr_unary(self, e);
    }

    fn visit_expr_if(&mut self, e: &'ast syn::ExprIf) {
        if !binds(&e.cond) {
            let at = e.cond.span().byte_range();
            let around = vec![(at.start..at.start, "!(".into()), (at.end..at.end, ")".into())];
            self.add(e.cond.span(), "condition negated", around, 2);
        }
        visit::visit_expr_if(self, e);
    }

    fn visit_expr_method_call(&mut self, e: &'ast syn::ExprMethodCall) {
        let name = e.method.to_string();
        let pairs = [
            ("min", "max"),
            ("max", "min"),
            ("any", "all"),
            ("all", "any"),
            ("cos", "sin"),
            ("sin", "cos"),
        ];
        if let Some((_, other)) = pairs.iter().find(|(n, _)| *n == name) {
            self.add(
                e.span(),
                &format!("{name} to {other}"),
                vec![(e.method.span().byte_range(), (*other).into())],
                1,
            );
        }
        visit::visit_expr_method_call(self, e);
    }

    fn visit_expr_lit(&mut self, e: &'ast syn::ExprLit) {
        let new = match &e.lit {
            Lit::Float(f) => f
                .base10_parse::<f64>()
                .ok()
                .map(|v| if v == 0.0 { 1.0 } else { 1.5 * v })
                .map(|v| format!("{v:?}{}", f.suffix())),
            Lit::Int(i) => {
                i.base10_parse::<u64>().ok().map(|v| format!("{}{}", v.wrapping_add(1), i.suffix()))
            }
            Lit::Bool(b) => Some((!b.value).to_string()),
            _ => None,
        };
        if let Some(new) = new {
            self.add(e.span(), &format!("to {new}"), vec![(e.span().byte_range(), new)], 4);
        }
    }

    fn visit_stmt(&mut self, s: &'ast Stmt) {
        if let Stmt::Expr(e @ (Expr::MethodCall(_) | Expr::Call(_)), Some(_)) = s {
            self.add(e.span(), "left out", vec![(e.span().byte_range(), "()".into())], 1);
        }
        visit::visit_stmt(self, s);
    }
}
