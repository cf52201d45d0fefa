//! `armcal explain`: cause, evidence, remedy and page of a code.

use anyhow::{Context, Result};
use clap::Args;
use serde::Serialize;

use crate::cli::exit::{Exit, UsageError};
use crate::cli::stdout::say;
use armcal_core::codes::{Code, CodeKind, Explanation, explanation};
use armcal_core::text::nearest;

#[derive(Debug, Args)]
pub(super) struct ExplainArgs {
    /// Code in brackets at the end of a message; without it, all codes are listed
    code: Option<String>,
    /// Print JSON instead of text: a list with one entry per code
    #[arg(long)]
    json: bool,
}

/// One code with its explanation.
#[derive(Serialize)]
struct Explained {
    code: Code,
    #[serde(flatten)]
    explanation: &'static Explanation,
}

pub(super) fn explain(args: &ExplainArgs) -> Result<Exit> {
    let asked: Option<Code> = args.code.as_deref().map(known).transpose()?;
    let chosen = Code::ALL.iter().copied().filter(|code| asked.is_none_or(|asked| asked == *code));
    let explained: Vec<Explained> =
        chosen.filter_map(|code| Some(Explained { code, explanation: explanation(code)? })).collect();
    if args.json {
        say(&serde_json::to_string_pretty(&explained).context("the explanations have no JSON form")?)?;
    } else if asked.is_some() {
        explained.iter().try_for_each(|Explained { code, explanation }| say(&format!("{code}\n{explanation}")))?;
    } else {
        say(&listed(&explained))?;
    }
    Ok(Exit::Ok)
}

fn known(text: &str) -> Result<Code, UsageError> {
    text.trim_matches(['[', ']']).parse().map_err(|unknown| {
        let near = nearest(text, Code::ALL.iter().map(|code| code.as_str()));
        let hint = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        UsageError::new(Code::NameUnknown, format!("{unknown}{hint}"))
    })
}

/// List of the codes by kind, each with its cause.
fn listed(explained: &[Explained]) -> String {
    let kinds = [CodeKind::Error, CodeKind::Refusal, CodeKind::Finding, CodeKind::Warning];
    let of_kind = |kind: CodeKind| {
        let codes = explained.iter().filter(move |explained| explained.explanation.kind == kind);
        let lines = codes.map(|Explained { code, explanation }| format!("  {code:<26}{}", explanation.cause));
        format!("{}\n{}", kind.word(), lines.collect::<Vec<_>>().join("\n"))
    };
    kinds.map(of_kind).join("\n\n")
}
