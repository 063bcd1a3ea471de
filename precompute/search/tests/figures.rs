//! Plots and tables of the documents are what docs/data gives.

#[path = "../examples/figures/data.rs"]
mod data;
#[path = "../examples/figures/documents.rs"]
mod documents;
#[path = "../examples/figures/plots.rs"]
mod plots;
#[path = "../examples/figures/summary.rs"]
mod summary;
#[path = "../examples/figures/svg.rs"]
mod svg;
#[path = "../examples/figures/tables.rs"]
mod tables;

#[test]
fn every_figure_of_the_documents_is_in_the_data() {
    let root = documents::root();
    let mut faults = Vec::new();
    for (file, text) in documents::outputs(&root).expect("the data give plots and tables") {
        // Git may end lines in its own way.
        let known = std::fs::read_to_string(root.join(&file)).unwrap_or_default().replace('\r', "");
        let changed = known.lines().zip(text.lines()).find(|(known, text)| known != text);
        if known != text {
            let (known, text) = changed.unwrap_or(("a shorter or longer file", ""));
            faults.push(format!("{}:\n  has  {known}\n  data {text}", file.display()));
        }
    }
    assert!(faults.is_empty(), "run `make figures`, or correct docs/data:\n{}", faults.join("\n"));
}
