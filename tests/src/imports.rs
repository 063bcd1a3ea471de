//! Which folder of a crate imports which, read from its sources.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::folder;

/// Imports between the parts of a crate: by importing and imported part, the files that do it.
pub type Imports = BTreeMap<(String, String), BTreeSet<String>>;

/// Reads every file under `root`, but tests. A part is a folder or file at the top; of parts named
/// in `split`, their own folders and files are parts, too (`gi/vpl`).
///
/// # Errors
/// When a folder or a file cannot be read.
pub fn imports(root: &Path, split: &[&str]) -> std::io::Result<Imports> {
    let mut found = Imports::new();
    for file in folder::files(root, "rs")? {
        let relative = file.strip_prefix(root).unwrap_or(&file).with_extension("");
        let mut module: Vec<String> =
            relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        if matches!(module.last().map(String::as_str), Some("mod" | "lib" | "main")) {
            module.pop();
        }
        if module.iter().any(|name| name.ends_with("tests") || name == "testing") {
            continue;
        }
        let Some(own) = part(&module, split) else { continue };
        for path in paths(&std::fs::read_to_string(&file)?) {
            let Some(path) = resolve(&path, &module) else { continue };
            if let Some(other) = part(&path, split).filter(|other| *other != own) {
                let files = found.entry((own.clone(), other)).or_default();
                files.insert(relative.display().to_string());
            }
        }
    }
    Ok(found)
}

/// The part that a module belongs to; none for the crate's root and for items of it.
fn part(module: &[String], split: &[&str]) -> Option<String> {
    let first = module.first().filter(|name| is_module(name))?;
    match module.get(1).filter(|name| split.contains(&first.as_str()) && is_module(name)) {
        Some(second) => Some(format!("{first}/{second}")),
        None => Some(first.clone()),
    }
}

fn is_module(name: &str) -> bool {
    name.chars().all(|c| c.is_ascii_lowercase() || c == '_' || c.is_ascii_digit())
}

/// A path from the crate's root; none where it leads out of the crate.
fn resolve(path: &str, module: &[String]) -> Option<Vec<String>> {
    let mut names = path.split("::").peekable();
    let mut resolved = match names.peek()? {
        &"crate" => Vec::new(),
        &"self" | &"super" => module.to_vec(),
        _ => return None,
    };
    while let Some(name) = names.next_if(|name| ["crate", "self", "super"].contains(name)) {
        if name == "super" {
            resolved.pop();
        }
    }
    resolved.extend(names.map(str::to_owned));
    Some(resolved)
}

/// Every path of a source that begins at `crate`, `self` or `super`, groups taken apart. Comments
/// and what follows `#[cfg(test)]` are left out.
fn paths(source: &str) -> Vec<String> {
    let code: String = source
        .split("#[cfg(test)]\nmod ")
        .next()
        .unwrap_or_default()
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join(" ");
    let mut paths = Vec::new();
    let mut rest = code.as_str();
    while let Some(start) =
        ["crate::", "super::", "self::"].iter().filter_map(|root| rest.find(root)).min()
    {
        let before = &rest[..start];
        let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
        // `my_crate::` is another word, and `pub(in crate::gi)` no import.
        let is_path = !before.chars().next_back().is_some_and(is_word) && !before.ends_with("(in ");
        let end = end_of_path(&rest[start..]) + start;
        if is_path {
            expand(&rest[start..end], "", &mut paths);
        }
        rest = &rest[end.max(start + 1)..];
    }
    paths
}

/// Where a path ends that begins a text: behind its group, if it has one.
fn end_of_path(text: &str) -> usize {
    let mut depth = 0;
    for (index, c) in text.char_indices() {
        match c {
            '{' if text[..index].ends_with("::") || depth > 0 => depth += 1,
            '}' if depth > 0 => {
                depth -= 1;
                if depth == 0 {
                    return index + 1;
                }
            }
            _ if depth > 0 || c.is_alphanumeric() || c == '_' || c == ':' => {}
            _ => return index,
        }
    }
    text.len()
}

fn expand(text: &str, prefix: &str, paths: &mut Vec<String>) {
    let text = text.trim();
    let Some((head, group)) = text.split_once('{') else {
        let name = text.split(" as ").next().unwrap_or_default().trim();
        if !name.is_empty() {
            paths.push(format!("{prefix}{name}"));
        }
        return;
    };
    let group = group.trim_end().strip_suffix('}').unwrap_or(group);
    let prefix = format!("{prefix}{}", head.trim());
    let (mut depth, mut start) = (0, 0);
    for (index, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                expand(&group[start..index], &prefix, paths);
                start = index + 1;
            }
            _ => {}
        }
    }
    expand(&group[start..], &prefix, paths);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_comments_and_tests_are_read_as_the_compiler_does() {
        let source = "use crate::a::{b, c::{D, e as f}}; // crate::no\npub(in crate::no) struct S;\nfn x() { super::y::z(); my_crate::n(); }\n#[cfg(test)]\nmod tests { use crate::no; }";
        let found = paths(source);
        assert_eq!(found, ["crate::a::b", "crate::a::c::D", "crate::a::c::e", "super::y::z"]);
        let module = ["p".to_owned(), "q".to_owned()];
        assert_eq!(resolve("super::y::z", &module), Some(vec!["p".into(), "y".into(), "z".into()]));
        assert_eq!(resolve("std::fs", &module), None);
        let path = |text: &str| text.split('/').map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(part(&path("gi/vpl/Plan"), &["gi"]), Some("gi/vpl".to_owned()));
        assert_eq!(part(&path("gi/FrugalGi"), &["gi"]), Some("gi".to_owned()));
        assert_eq!(part(&path("knobs/space"), &["gi"]), Some("knobs".to_owned()));
    }
}
