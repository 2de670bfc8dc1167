//! `pcadlang check`.

use crate::args::Check;
use pcadlang_library::Program;
use pcadlang_runs::failure::Failure;
use pcadlang_runs::term::has_colors;
use pcadlang_syntax::diag::render;

/// Checks each program, and lists its params and the data that it needs.
pub fn check(a: &Check) -> Result<(), Failure> {
    let mut failed = Vec::new();
    for path in &a.programs {
        let program = match Program::open_allowing(path, &a.allowed.allow_read) {
            Ok(p) => p,
            Err(e) => {
                error_text!("{}", render(&e.sources, &e.diagnostics, has_colors()));
                failed.push(path.as_str());
                continue;
            }
        };
        let interface = program.interface();
        match program.without_data().compile() {
            Ok(model) => {
                let (sources, warnings) = model.warnings();
                if !warnings.is_empty() {
                    error_text!("{}", render(sources, warnings, has_colors()));
                }
                print_line!("{path}: no mistakes found");
                for p in interface.params {
                    let (default, help) =
                        (p.default.unwrap_or_default(), p.help.unwrap_or_default());
                    print_line!("{}", format!("  --set {} = {default}  {help}", p.name).trim_end());
                }
                for d in interface.data.iter().filter(|d| !d.has_default) {
                    let (ty, help) =
                        (d.ty.as_deref().unwrap_or("any"), d.help.as_deref().unwrap_or_default());
                    print_line!(
                        "{}",
                        format!("  --observe {}=FILE ({ty})  {help}", d.name).trim_end()
                    );
                }
            }
            Err(e) => {
                error_text!("{}", render(&e.sources, &e.diagnostics, has_colors()));
                failed.push(path.as_str());
            }
        }
    }
    if failed.is_empty() {
        Ok(())
    } else {
        Err(pcadlang_runs::failure::plain(format!(
            "{} of {} programs have mistakes: {}",
            failed.len(),
            a.programs.len(),
            failed.join(", ")
        )))
    }
}
