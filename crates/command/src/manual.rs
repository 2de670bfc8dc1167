//! `pcadlang completions` and `pcadlang man`.

use clap::{Args, Command, ValueHint};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files;
use std::io::Write;
use std::path::PathBuf;

/// `completions`.
#[derive(Args, Debug)]
pub struct Completions {
    /// The shell
    pub shell: clap_complete::Shell,
}

/// `man`.
#[derive(Args, Debug)]
pub struct Man {
    /// The command whose page is printed, such as run [default: the page of pcadlang]
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    pub command: Option<String>,
    /// The folder to write the pages to, one per command: pcadlang.1, pcadlang-run.1, …
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,
}

/// Prints the completion script of a shell.
pub fn completions(a: &Completions, mut command: Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(a.shell, &mut command, "pcadlang", &mut script);
    print(&script)
}

/// Prints the manual page of the program or of a command, or writes all of them to a folder.
pub fn man(a: &Man, command: Command) -> Result<(), Failure> {
    let mut command = command.disable_help_subcommand(true);
    command.build();
    if let Some(name) = &a.command {
        let sub = command.find_subcommand(name).ok_or_else(|| unknown(name, &command))?;
        return print(&page(&named(sub))?);
    }
    let Some(folder) = &a.out else { return print(&page(&command)?) };
    std::fs::create_dir_all(folder)
        .map_err(|e| plain(format!("cannot make {}: {e}", folder.display())))?;
    files::write(&folder.join("pcadlang.1"), &page(&command)?)?;
    for sub in command.get_subcommands() {
        let sub = named(sub);
        let name = sub.get_display_name().unwrap_or_default();
        files::write(&folder.join(format!("{name}.1")), &page(&sub)?)?;
    }
    Ok(())
}

/// A command under the name of its page, such as pcadlang-run.
fn named(command: &Command) -> Command {
    command.clone().display_name(format!("pcadlang-{}", command.get_name()))
}

fn unknown(name: &str, command: &Command) -> Failure {
    let all: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
    plain(format!("there is no command `{name}`"))
        .hint(format!("the commands are {}", all.join(", ")))
}

/// Renders a manual page.
fn page(command: &Command) -> Result<Vec<u8>, Failure> {
    let mut text = Vec::new();
    let source = concat!("pcadlang ", env!("CARGO_PKG_VERSION"));
    let rendered = clap_mangen::Man::new(command.clone()).source(source).render(&mut text);
    rendered.map_err(|e| plain(format!("cannot write the page of {}: {e}", command.get_name())))?;
    Ok(text)
}

/// Prints a text; a closed pipe is not an error.
fn print(text: &[u8]) -> Result<(), Failure> {
    match std::io::stdout().write_all(text) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(plain(format!("cannot write: {e}")))
        }
        _ => Ok(()),
    }
}
