//! Arguments that name a robot or a routine: a path, or the name of one that comes with the program.

use std::path::PathBuf;

use clap::builder::{PathBufValueParser, TypedValueParser};

use crate::front::shared::{robot_folder, routine_file};

pub(super) fn robot() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|given| robot_folder(&given))
}

pub(super) fn routine() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|given| routine_file(&given))
}
