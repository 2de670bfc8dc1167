//! `:render`: a picture of the scene.

use super::picture::ViewPicture;
use super::reply::Reply;
use super::state::Session;
use crate::bank;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::value::Value;
use pcadlang_library::scene::ImageValue;
use pcadlang_syntax::diag::nearest;
use std::path::PathBuf;

impl Session {
    /// `:render [name] [file]`.
    pub(super) fn render(&mut self, text: &str) -> Result<Reply, Failure> {
        let mut words: Vec<&str> = text.split_whitespace().collect();
        let is_file = |w: &&str| [".png", ".PNG"].iter().any(|e| w.ends_with(e));
        let file = words.last().copied().filter(is_file).map(|f| f.trim_matches('"'));
        words.truncate(words.len() - usize::from(file.is_some()));
        file.map_or(Ok(()), |f| self.permit(f))?;
        let draws = self.looks();
        let operand = match words[..] {
            [] => bank::picture(&mut self.trace, draws).ok_or_else(|| {
                plain("the program has no view and no solid")
                    .hint("let view = scene.render(solid);")
            })?,
            [name] => self.global(name)?,
            _ => return Err(plain("`:render` takes a name and a file that ends in .png")),
        };
        let values =
            self.trace.query(&[operand], draws).map_err(|e| Failure::run(&self.model, *e))?;
        let Some(view) = values.first().and_then(|v| bank::as_view(v, None)) else {
            let what = values.first().map_or("nothing", |v| v.type_name());
            return Err(plain(format!("`{text}` is {what}: only views and solids can be seen")));
        };
        let picture = ViewPicture {
            view,
            image: observed_image(self.model.code()),
            file: file.map(PathBuf::from),
        };
        Ok(Reply { picture: Some(picture), ..Reply::default() })
    }

    fn global(&self, name: &str) -> Result<Operand, Failure> {
        let globals = &self.model.code().globals;
        globals.get(name).copied().ok_or_else(|| {
            let trouble = plain(format!("there is no `{name}`"));
            match nearest(name, globals.keys().map(|n| &**n)) {
                Some(n) => trouble.hint(format!("did you mean `{n}`?")),
                None => trouble,
            }
        })
    }
}

/// Returns the first photograph, or contour map, among a program's data: an
/// [`ImageValue`].
pub fn observed_image(code: &Code) -> Option<Value> {
    let of = |o: &Operand| match o {
        Operand::Const(i) => Some(code.const_value(*i).clone()),
        _ => None,
    };
    let is_image = |v: &Value| v.downcast::<ImageValue>().is_some();
    code.globals.values().filter_map(of).find(is_image)
}
