//! `armcal schema`: the JSON Schema of a kind of file.

use anyhow::Result;
use clap::Args;

use crate::cli::exit::{Exit, UsageError};
use crate::cli::stdout::say;
use armcal_core::codes::Code;
use armcal_core::kind::Kind;
use armcal_core::schema::committed;
use armcal_core::text::nearest;

#[derive(Debug, Args)]
pub(super) struct SchemaArgs {
    /// Kind of file, as its key `kind` states it; without it, all kinds are listed
    kind: Option<String>,
}

pub(super) fn schema(args: &SchemaArgs) -> Result<Exit> {
    match &args.kind {
        Some(name) => say(committed(known(name)?).trim_end())?,
        None => {
            let line = |kind: Kind| format!("{:<16}{}; {}", kind.name(), kind.in_words(), kind.takers());
            say(&Kind::ALL.map(line).join("\n"))?;
        }
    }
    Ok(Exit::Ok)
}

fn known(name: &str) -> Result<Kind, UsageError> {
    Kind::named(name).ok_or_else(|| {
        let names = Kind::ALL.map(Kind::name);
        let hint = nearest(name, names).map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        let problem = format!("`{name}` is no kind of file; there are {}{hint}", names.join(", "));
        UsageError::new(Code::NameUnknown, problem)
    })
}
