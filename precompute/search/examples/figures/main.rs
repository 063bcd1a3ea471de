//! Draws every plot of the documents, and writes their tables, from the files in docs/data: `cargo run -p
//! frugal_search --example figures`. `make figures` first plays the records anew.

mod data;
mod documents;
mod plots;
mod summary;
mod svg;
mod tables;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = documents::root();
    for (file, text) in documents::outputs(&root)? {
        let path = root.join(&file);
        if std::fs::read_to_string(&path).is_ok_and(|known| known == text) {
            continue;
        }
        std::fs::write(path, text)?;
        println!("wrote {}", file.display());
    }
    Ok(())
}
