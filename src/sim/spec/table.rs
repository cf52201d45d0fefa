//! Definition of one table of `[world]`: keys, defaults and allowed ranges.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::de::DeserializeOwned;

use armcal_core::robot::FileIssue;

/// Defines one table of `[world]`: figures with defaults and allowed ranges (inclusive), then fields of other types.
macro_rules! table {
    (
        $(#[$doc:meta])* $name:ident {
            $($(#[$field_doc:meta])* $field:ident = $default:expr, in $range:expr;)+
        }
        $(and { $($(#[$other_doc:meta])* $other:ident: $kind:ty = $other_default:expr;)+ })?
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: f64,)+
            $($($(#[$other_doc])* pub $other: $kind,)+)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)+ $($($other: $other_default,)+)? }
            }
        }

        impl CheckedTable for $name {
            fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue> {
                $({
                    let range: RangeInclusive<f64> = $range;
                    FileIssue::check_range(file, &format!("{table}.{}", stringify!($field)), self.$field, range)?;
                })+
                Ok(())
            }
        }

        impl $name {
            /// Returns the keys of this table with their defaults and allowed ranges.
            pub(super) fn figures(table: &str) -> Vec<$crate::spec::table::Figure> {
                let usual = Self::default();
                vec![$($crate::spec::table::Figure {
                    key: format!("world.{table}.{}", stringify!($field)),
                    usual: usual.$field,
                    range: $range,
                }),+]
            }
        }
    };
}
pub(super) use table;

/// Key of `[world]` that holds a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Key as in `--set`.
    pub key: String,
    /// Value in the standard world.
    pub usual: f64,
    /// Allowed range.
    pub range: RangeInclusive<f64>,
}

pub(super) trait CheckedTable: DeserializeOwned + Default {
    fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue>;
}

/// One degree, rad.
pub(super) const DEG: f64 = std::f64::consts::PI / 180.0;
