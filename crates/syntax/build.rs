//! Generates the parser from `grammar/pcad.lalrpop`.

fn main() {
    let result = std::env::var("OUT_DIR").map_err(Into::into).and_then(|out| {
        lalrpop::Configuration::new()
            .set_in_dir("../../grammar")
            .set_out_dir(out)
            .emit_rerun_directives(true)
            .process()
    });
    if let Err(error) = result {
        eprintln!("the grammar does not build: {error}");
        std::process::exit(1);
    }
}
