//! `:save` and `:load`: the program as a `.pcad` file, with the trace beside it; the contents of
//! exported files.

use super::reply::{Reply, Request};
use super::state::Session;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::load::reason;
use pcadlang_engine::lang::lower::Export;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{SavedTrace, Trace};
use pcadlang_library::scene::{SolidValue, ViewValue};
use pcadlang_report::write_file;
use pcadlang_scene::geom::{glb, obj};
use pcadlang_syntax::ast::ExprKind;
use std::path::Path;
use std::sync::Arc;

impl Session {
    /// Makes a saved state of the program the state of the session.
    ///
    /// # Errors
    /// If the saved state is of another program, or of other data or settings.
    pub fn take_up(&mut self, saved: &SavedTrace) -> Result<Reply, Failure> {
        let code = Arc::clone(self.model.code());
        let loaded = Trace::load(code, self.model.hash(), saved, self.limits.clone());
        self.trace = loaded.map_err(|e| plain(e.to_string()))?;
        Ok(Reply::text(self.summary()))
    }

    /// `:save NAME`. Unless `overwrites` is true, it asks before overwriting files that
    /// this session neither wrote nor loaded.
    pub(super) fn save(&mut self, name: &str, overwrites: bool) -> Result<Reply, Failure> {
        let name = bare(name);
        self.permit(name)?;
        let (program, trace) = (format!("{name}.pcad"), format!("{name}.trace.json"));
        let there = [&program, &trace]
            .into_iter()
            .find(|f| Path::new(f).exists() && !self.own_files.contains(*f));
        if let Some(file) = there.filter(|_| !overwrites) {
            let question = format!("{file} exists; overwrite it?");
            return Ok(Reply::request(Request::Confirm {
                question,
                then: format!(":save! {name}"),
            }));
        }
        let written = self.program.written_as(&program).map_err(|e| {
            let first = e.diagnostics.first().map_or_else(String::new, |d| d.message.clone());
            plain(format!("{program} would not load: {first}"))
                .hint("its included files are relative to its own folder: save it there")
        })?;
        let saved = self.trace.save(&written.hash());
        let bytes = serde_json::to_vec(&saved).map_err(|e| plain(e.to_string()))?;
        // The trace first: a program without a trace can be loaded, but a trace beside an
        // older program would be refused.
        for (path, bytes) in [(&trace, &bytes[..]), (&program, self.text().as_bytes())] {
            write_file(Path::new(path), bytes)
                .map_err(|e| plain(format!("cannot write {path}: {}", reason(&e))))?;
        }
        let said = format!("{program}, {trace}\n");
        self.own_files.extend([program, trace]);
        Ok(Reply::text(said))
    }

    /// `:load NAME`.
    pub(super) fn load(&mut self, name: &str) -> Result<Reply, Failure> {
        self.permit(name.trim_matches('"'))?;
        let folder = Path::new(name.trim_matches('"'));
        if folder.join("run.json").is_file() {
            return Ok(Reply::request(Request::Open(folder.to_owned())));
        }
        let path = format!("{}.trace.json", bare(name));
        let program = self.program.replaced(&format!("{}.pcad", bare(name)))?;
        let (loaded, note) = Session::open(program, self.seed, self.limits.stop.clone())?;
        let past = self.remember(&format!(":load {name}"));
        let (mut said, mut trace) = (note.text, loaded.trace);
        if let Some(saved) = saved_trace(Path::new(&path))? {
            let code = Arc::clone(loaded.model.code());
            trace = Trace::load(code, loaded.model.hash(), &saved, self.limits.clone()).map_err(
                |e| plain(format!("{path}: {e}")).hint("without that file the program loads alone"),
            )?;
            said += &format!("with the trace of {path}\n");
        }
        (self.program, self.model, self.trace) = (loaded.program, loaded.model, trace);
        self.keep(past);
        self.own_files.extend([format!("{}.pcad", bare(name)), path]);
        Ok(Reply::text(said + &self.summary()))
    }
}

/// Reads the saved trace in a file; `None` if the file does not exist.
fn saved_trace(path: &Path) -> Result<Option<SavedTrace>, Failure> {
    let wrong = |e: String| plain(format!("{}: {e}", path.display()));
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(wrong(reason(&e))),
    };
    serde_json::from_slice(&bytes).map(Some).map_err(|e| wrong(format!("not a saved trace: {e}")))
}

/// Removes quotes and the endings that `:save` adds.
fn bare(name: &str) -> &str {
    let name = name.trim_matches('"');
    name.strip_suffix(".pcad").or_else(|| name.strip_suffix(".trace.json")).unwrap_or(name)
}

/// Returns the operand of an export; that of `best(e)` is `e`, evaluated in the current
/// state.
pub fn exported_operand(code: &Code, x: &Export) -> Option<Operand> {
    let inner = match &x.expr.kind {
        ExprKind::Call { args, .. } if args.len() == 1 => &args[0].value,
        _ => &x.expr,
    };
    code.queries.get(&inner.span).or_else(|| code.queries.get(&x.expr.span)).copied()
}

/// Returns the contents of a file with a value; the file's name determines the format.
///
/// # Errors
/// If a solid has no mesh, since it is too far away or too small for single precision.
pub fn exported(value: &Value, file: &str) -> Result<Vec<u8>, String> {
    let solid = value.downcast::<ViewValue>().map(|v| v.0.solid_in_files());
    let Some(solid) = solid.or_else(|| value.downcast::<SolidValue>().map(|s| s.0.clone())) else {
        return Ok(value.to_string().into_bytes());
    };
    let all = solid.objects().map_err(|e| e.to_string())?;
    Ok(if file.ends_with(".glb") { glb::write(&all) } else { obj::write(&all).into_bytes() })
}
