//! `armcal-lab`: measures armcal's parts against known truth. All code is in `commands`.

mod commands;

fn main() -> std::process::ExitCode {
    commands::main()
}
