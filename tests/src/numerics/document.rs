//! The blocks of the document: between `<!-- numbers: NAME -->` and `<!-- end -->`, each on a line of its own.

/// A block as it is to be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Name in the document.
    pub name: String,
    /// Whole lines.
    pub text: String,
}

impl Block {
    /// A block of these lines.
    #[must_use]
    pub fn new(name: &str, text: impl Into<String>) -> Self {
        Self { name: name.to_owned(), text: text.into() }
    }
}

/// Why a document cannot take its blocks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DocumentError {
    /// A block has no place, or more than one.
    #[error("`{start}` is {count} times in the document, and must be once")]
    Place {
        /// The line that starts it.
        start: String,
        /// How often it is there.
        count: usize,
    },
    /// A place has no end.
    #[error("line {line}: `{start}` has no `<!-- end -->` before the next block")]
    NoEnd {
        /// The line of the document, from 1.
        line: usize,
        /// The line that starts it.
        start: String,
    },
    /// The document has a block that no experiment makes.
    #[error("line {line}: no experiment makes `{start}`")]
    Unknown {
        /// The line of the document, from 1.
        line: usize,
        /// The line that starts it.
        start: String,
    },
}

const START: &str = "<!-- numbers: ";
const END: &str = "<!-- end -->";

/// The document with the blocks in their places. `others` may be in it, and stay as they are.
///
/// # Errors
/// If the places of the document and the blocks are not the same.
pub fn filled(document: &str, blocks: &[Block], others: &[&str]) -> Result<String, DocumentError> {
    let start_of = |name: &str| format!("{START}{name} -->");
    for name in blocks.iter().map(|block| &*block.name).chain(others.iter().copied()) {
        let start = start_of(name);
        let count = document.lines().filter(|line| *line == start).count();
        if count != 1 {
            return Err(DocumentError::Place { start, count });
        }
    }
    let mut text = String::new();
    let mut lines = (1..).zip(document.lines());
    while let Some((number, start)) = lines.next() {
        text += &format!("{start}\n");
        if !start.starts_with(START) {
            continue;
        }
        let mut old = String::new();
        loop {
            match lines.next() {
                Some((_, line)) if line == END => break,
                Some((_, line)) if !line.starts_with(START) => old += &format!("{line}\n"),
                _ => return Err(DocumentError::NoEnd { line: number, start: start.to_owned() }),
            }
        }
        match blocks.iter().find(|block| start_of(&block.name) == start) {
            Some(block) => text += &block.text,
            None if others.iter().any(|name| start_of(name) == start) => text += &old,
            None => return Err(DocumentError::Unknown { line: number, start: start.to_owned() }),
        }
        text += &format!("{END}\n");
    }
    Ok(text)
}

/// The first line that two documents do not share, as text; none if they are the same.
#[must_use]
pub fn difference(is: &str, should_be: &str) -> Option<String> {
    if is == should_be {
        return None;
    }
    let mut pairs = is.lines().zip(should_be.lines()).enumerate();
    let found = pairs.find(|(_, (is, should_be))| is != should_be);
    Some(match found {
        Some((k, (is, should_be))) => format!("line {}:\n  has    {is}\n  not    {should_be}", k + 1),
        None => format!("{} lines, not {}", is.lines().count(), should_be.lines().count()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOCUMENT: &str = "one\n<!-- numbers: a -->\nold\n<!-- end -->\ntwo\n<!-- numbers: b -->\n<!-- end -->\n";

    fn a() -> Block {
        Block::new("a", "new\nlines\n")
    }

    #[test]
    fn blocks_replace_what_is_between_their_lines() {
        let new = filled(DOCUMENT, &[a(), Block::new("b", "x\n")], &[]).unwrap();
        let expected =
            "one\n<!-- numbers: a -->\nnew\nlines\n<!-- end -->\ntwo\n<!-- numbers: b -->\nx\n<!-- end -->\n";
        assert_eq!(new, expected);
        assert_eq!(filled(&new, &[a(), Block::new("b", "x\n")], &[]).unwrap(), new);
        // A block that was not asked for stays.
        assert_eq!(filled(&new, &[Block::new("a", "old\n")], &["b"]).unwrap(), new.replace("new\nlines", "old"));
    }

    #[test]
    fn places_and_blocks_must_be_the_same() {
        let error = |document: &str, blocks: &[Block], others: &[&str]| {
            filled(document, blocks, others).unwrap_err().to_string()
        };
        assert!(
            error(DOCUMENT, &[a(), Block::new("c", "")], &["b"]).contains("numbers: c --> `".trim_end_matches(" `"))
        );
        assert!(error(DOCUMENT, &[a()], &[]).contains("line 6: no experiment makes"));
        assert!(error(DOCUMENT, &[a()], &["b", "d"]).contains("0 times"));
        assert!(error(&DOCUMENT.repeat(2), &[a()], &["b"]).contains("2 times"));
        let open = DOCUMENT.replacen("<!-- end -->\n", "", 1);
        assert!(error(&open, &[a()], &["b"]).contains("line 2"));
        assert!(error(DOCUMENT.trim_end_matches("<!-- end -->\n"), &[a()], &["b"]).contains("line 6"));
    }

    #[test]
    fn the_first_difference_is_named() {
        assert_eq!(difference("a\nb\n", "a\nb\n"), None);
        assert!(difference("a\nb\n", "a\nc\n").is_some_and(|text| text.contains("line 2") && text.contains('c')));
        assert_eq!(difference("a\n", "a\nb\n").unwrap(), "1 lines, not 2");
    }
}
