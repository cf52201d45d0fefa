//! The help texts of the program and of each command.

use armcal::cli::command;

use crate::support::texts::{Texts, note};

/// Width of a usual terminal, in columns.
const WIDTH: usize = 100;

#[test]
fn help_of_each_command() {
    let _texts = Texts::of("help_of_each_command");
    let mut all = command().term_width(WIDTH);
    all.build();
    note("armcal --help", &all.render_long_help().to_string());
    for command in all.get_subcommands_mut() {
        let name = command.get_name().to_owned();
        note(&format!("armcal {name} --help"), &command.render_long_help().to_string());
    }
}
