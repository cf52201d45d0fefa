//! `armcal-lab`: armcal's parts measured against known truth. Everything is in `commands`.

mod commands;

fn main() -> std::process::ExitCode {
    commands::main()
}
