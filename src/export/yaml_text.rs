//! Values in a form that all YAML readers accept.

/// A string in YAML's double quotes, which accept JSON's escapes.
pub(super) fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// A number that every YAML reader accepts as a double: with a point, and a sign in its exponent (`1.0e-7`, `.nan`).
pub(super) fn double(value: f64) -> String {
    if value.is_nan() {
        return ".nan".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { ".inf" } else { "-.inf" }.to_owned();
    }
    let text = format!("{value:?}");
    let Some((digits, exponent)) = text.split_once('e') else { return text };
    let point = if digits.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{digits}{point}e{sign}{exponent}")
}

/// A list of numbers on one line.
pub(super) fn doubles(values: impl IntoIterator<Item = f64>) -> String {
    let values: Vec<String> = values.into_iter().map(double).collect();
    format!("[{}]", values.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubles_have_a_point_and_a_signed_exponent() {
        let written = [0.0, -3.0, 1e-7, 1.5e-9, 1e300, 0.25, f64::NAN, f64::NEG_INFINITY].map(double);
        assert_eq!(written, ["0.0", "-3.0", "1.0e-7", "1.5e-9", "1.0e+300", "0.25", ".nan", "-.inf"]);
    }

    #[test]
    fn strings_are_quoted() {
        assert_eq!(quoted("a: \"b\"\n"), "\"a: \\\"b\\\"\\n\"");
    }
}
