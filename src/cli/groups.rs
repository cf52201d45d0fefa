//! The commands in groups for `armcal --help`; clap has only one list.

use std::fmt::Write as _;

use clap::Command;

/// Headings, and the names of their commands.
const GROUPS: [(&str, &[&str]); 4] = [
    ("Calibrate", &["calibrate", "plan", "inspect", "check", "export", "replay", "tagmap", "new-robot"]),
    ("Real arm", &["drive", "discover", "watch"]),
    ("Test", &["run", "campaign", "regress", "serve"]),
    ("Help", &["schema", "explain", "help"]),
];
/// Width of the names in columns; `WIDTH` is that of a line.
const NAMES: usize = 12;
const WIDTH: usize = 80;

/// Replaces the command's help by one with its commands in groups.
pub(super) fn grouped(command: Command) -> Command {
    let mut list = String::new();
    for (heading, names) in GROUPS {
        let _ = writeln!(list, "{heading}:");
        for name in names {
            let about = match command.find_subcommand(name).and_then(Command::get_about) {
                Some(about) => about.to_string(),
                None if *name == "help" => "Print the help of a command".to_owned(),
                // A command of a part that this build lacks.
                None => continue,
            };
            let indent = " ".repeat(NAMES + 2);
            let options = textwrap::Options::new(WIDTH).subsequent_indent(&indent);
            let _ = writeln!(list, "{}", textwrap::fill(&format!("  {name:<NAMES$}{about}"), options));
        }
        list.push('\n');
    }
    command.help_template(format!("{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}Options:\n{{options}}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST_COMMANDS: usize = 17;
    const MOST_FLAGS: usize = 110;

    fn visible(command: &Command) -> impl Iterator<Item = &Command> {
        command.get_subcommands().filter(|below| !below.is_hide_set())
    }

    /// The limits keep the numbers small: a new command or flag must replace an old one.
    #[test]
    fn commands_and_flags_stay_few() {
        let command = crate::cli::command();
        let flags = |command: &Command| {
            let named = command.get_arguments().filter(|argument| !argument.is_hide_set());
            named
                .filter(|argument| argument.get_long().is_some_and(|name| !["help", "version"].contains(&name)))
                .count()
        };
        let n_commands = visible(&command).count();
        let n_flags = flags(&command) + visible(&command).map(flags).sum::<usize>();
        eprintln!("{n_commands} commands, {n_flags} flags");
        assert!(n_commands <= MOST_COMMANDS && n_flags <= MOST_FLAGS, "{n_commands} commands, {n_flags} flags");
    }

    #[test]
    fn each_visible_command_is_in_one_group() {
        let command = crate::cli::command();
        for name in visible(&command).map(Command::get_name) {
            let n = GROUPS.iter().filter(|(_, names)| names.contains(&name)).count();
            assert_eq!(n, 1, "{name}");
        }
    }
}
