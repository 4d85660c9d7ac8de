use crate::window::widgets::fields::capitalised;

/// Returns the text with a full stop, and with a capital unless it begins with the name of a column or file.
pub fn sentence(text: &str) -> String {
    const WORDS: [&str; 11] = [
        "the", "for", "no", "none", "there", "a", "all", "always", "column", "too", "twice",
    ];
    let first = text.split_whitespace().next().unwrap_or_default();
    let mut sentence = text.to_owned();
    if WORDS.contains(&first) {
        sentence = capitalised(&sentence);
    }
    if !sentence.ends_with(['.', '!', '?']) {
        sentence.push('.');
    }
    sentence
}
