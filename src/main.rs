//! The binary: everything is in the library's `cli`.

fn main() -> std::process::ExitCode {
    armcal::cli::main(std::env::args_os()).into()
}
