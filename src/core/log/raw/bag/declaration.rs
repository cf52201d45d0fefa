//! Names of a table's columns, from the text of its declaration.

/// Words that begin a constraint of the table rather than a column.
const CONSTRAINTS: [&str; 5] = ["constraint", "primary", "unique", "check", "foreign"];

/// Returns the names in lower case, in the order of the columns; `None` if the text has no list of columns.
pub fn column_names(sql: &str) -> Option<Vec<String>> {
    let plain = without_comments(sql);
    let mut names = Vec::new();
    let (mut depth, mut quote, mut start) = (0_u32, None, 0);
    for (at, c) in plain.char_indices() {
        match (quote, c) {
            (Some(end), _) if c == end => quote = None,
            (Some(_), _) => {}
            (None, '"' | '`' | '\'') => quote = Some(c),
            (None, '[') => quote = Some(']'),
            (None, '(') => {
                depth += 1;
                start = if depth == 1 { at + 1 } else { start };
            }
            (None, ',' | ')') if depth == 1 => {
                names.extend(column_name(&plain[start..at]));
                start = at + 1;
                if c == ')' {
                    return Some(names);
                }
            }
            (None, ')') => depth = depth.checked_sub(1)?,
            _ => {}
        }
    }
    None
}

fn column_name(definition: &str) -> Option<String> {
    let definition = definition.trim();
    let quoted = definition.strip_prefix(['"', '`', '\'', '[']);
    if let Some(rest) = quoted {
        return rest.find(['"', '`', '\'', ']']).map(|end| rest[..end].to_lowercase());
    }
    let name = definition.split(|c: char| c.is_whitespace() || c == '(').next()?.to_lowercase();
    (!name.is_empty() && !CONSTRAINTS.contains(&name.as_str())).then_some(name)
}

/// Replaces comments of both kinds by blanks. Each byte is read once, regardless of the number of comments and of their
/// ends.
fn without_comments(sql: &str) -> String {
    let mut plain = String::with_capacity(sql.len());
    let mut rest = sql;
    while let Some(at) = rest.as_bytes().windows(2).position(|two| matches!(two, b"--" | b"/*")) {
        plain.push_str(&rest[..at]);
        plain.push(' ');
        let end = if rest[at..].starts_with("--") { "\n" } else { "*/" };
        let comment = &rest[at + 2..];
        rest = comment.find(end).map_or("", |from| &comment[from + end.len()..]);
    }
    plain + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An earlier version searched all of the rest for each kind of comment.
    #[test]
    fn many_comments_are_passed_over() {
        for comment in ["/* */", "--\n", "/*/ -- */", "-- /*\n"] {
            let sql = format!("CREATE TABLE a({}b)", comment.repeat(300_000));
            assert_eq!(column_names(&sql).as_deref(), Some(&["b".to_owned()][..]), "{comment}");
        }
        assert_eq!(column_names(&format!("CREATE TABLE a(b{}", "/*".repeat(300_000))), None);
    }

    #[test]
    fn columns_are_named_in_their_order() {
        let of = |sql: &str| column_names(sql).map(|names| names.join(" "));
        assert_eq!(
            of("CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, \
                data BLOB NOT NULL)")
            .as_deref(),
            Some("id topic_id timestamp data")
        );
        assert_eq!(
            of("create table \"a(b\" (\"Id\" int, -- the row's, number\n [other one] decimal(10,2) default 'x,y', \
                `c`/* , d */text, primary key(id), check (c > 0))"),
            of("create table a (Id int, [other one] decimal(10,2), c text)")
        );
        assert_eq!((of("CREATE TABLE a"), of("CREATE TABLE a (b"), of("")), (None, None, None));
        assert_eq!(of("CREATE VIRTUAL TABLE a USING fts5(b)").as_deref(), Some("b"));
    }
}
