use std::path::Path;

/// Longest identifier: with what is added to it, within the 63 characters of MATLAB's.
const LONGEST: usize = 40;

/// Name for functions and files, after the folder of the bundle: lower-case letters, digits and underscores.
pub(super) fn identifier(path: &Path) -> String {
    let name = path
        .file_stem()
        .map(|name| name.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    let plain: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    let words: Vec<_> = plain.split('_').filter(|word| !word.is_empty()).collect();
    let mut joined = words.join("_");
    if !joined.starts_with(|c: char| c.is_ascii_lowercase()) {
        joined.insert_str(0, if joined.is_empty() { "network" } else { "network_" });
    }
    joined.truncate(LONGEST);
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_folder_gives_a_name() {
        let cases = [
            ("out/Left hand-2", "left_hand_2"),
            ("10x10_5x30", "network_10x10_5x30"),
            ("hånd", "h_nd"),
            ("__", "network"),
            ("a.b.bundle", "a_b"),
            ("", "network"),
        ];
        for (path, expected) in cases {
            assert_eq!(identifier(Path::new(path)), expected);
        }
        assert_eq!(identifier(Path::new(&"x".repeat(300))).len(), LONGEST);
    }
}
