//! `armcal completions` and `armcal man`: descriptions of the commands for shells and `man`.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use clap_complete::Shell;

use crate::cli::exit::Exit;
use crate::cli::stdout::say;
use crate::output;

#[derive(Debug, Args)]
pub(super) struct CompletionsArgs {
    /// Shell that reads the script
    shell: Shell,
}

/// Prints the script that completes commands and options.
pub(super) fn completions(args: &CompletionsArgs, mut command: clap::Command) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "armcal", &mut script);
    say(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Exit::Ok)
}

#[derive(Debug, Args)]
pub(super) struct ManArgs {
    /// Folder for the pages armcal.1, armcal-run.1 and so on
    folder: PathBuf,
}

/// Writes a page for the program and one for each command.
pub(super) fn man(args: &ManArgs, command: clap::Command) -> Result<Exit> {
    output::make_folder(&args.folder)?;
    let shown = args.folder.display();
    clap_mangen::generate_to(command, &args.folder).with_context(|| format!("{shown}: cannot be written"))?;
    say(&format!("written      {shown}"))?;
    Ok(Exit::Ok)
}
