//! Structs and constants of the shaders are what the plugin assumes.

use std::path::PathBuf;

use bevy_frugal_gi::gi::GiPlugin;
use bevy_frugal_gi::gi::inspect::{SHADER_CONSTANTS, STRUCT_BYTES};

tests!(
    structs_have_the_sizes_that_buffers_assume,
    the_check_detects_a_larger_struct,
    constants_are_those_of_the_plugin,
    no_workgroup_has_more_threads_than_the_required_limits
);

const SHADERS: [&str; 9] = [
    include_str!("../../../plugin/src/gi/texels/texels.wgsl"),
    include_str!("../../../plugin/src/gi/vpl/vpl.wgsl"),
    include_str!("../../../plugin/src/gi/cache/table.wgsl"),
    include_str!("../../../plugin/src/gi/forward/probe.wgsl"),
    include_str!("../../../plugin/src/gi/trace/trace.wgsl"),
    include_str!("../../../plugin/src/gi/rsm/resolve.wgsl"),
    include_str!("../../../plugin/src/gi/bounces/reflect.wgsl"),
    include_str!("../../../plugin/src/gi/sky/sky.wgsl"),
    include_str!("../../../plugin/src/gi/sky/fill.wgsl"),
];

/// Size of the struct `name` in a buffer, in bytes, by the shader compiler. The struct is extracted
/// from its file, because imports are not plain WGSL.
fn size(name: &str, sources: &[&str]) -> u32 {
    let start = format!("struct {name} {{");
    let text = sources.iter().find_map(|source| source.find(&start).map(|at| &source[at..]));
    let text = text.unwrap_or_else(|| panic!("no shader has a struct {name}"));
    let text = &text[..=text.find("\n}").unwrap_or_else(|| panic!("struct {name} has no end")) + 1];
    let module =
        naga::front::wgsl::parse_str(text).unwrap_or_else(|error| panic!("{name}: {error}"));
    module
        .types
        .iter()
        .find_map(|(_, kind)| match &kind.inner {
            // The span includes padding to the alignment, as in an array.
            naga::TypeInner::Struct { span, .. } => Some(*span),
            _ => None,
        })
        .unwrap_or_else(|| panic!("struct {name} is gone"))
}

fn structs_have_the_sizes_that_buffers_assume() {
    for (name, bytes) in STRUCT_BYTES {
        assert_eq!(u64::from(size(name, &SHADERS)), bytes, "{name}");
    }
}

fn the_check_detects_a_larger_struct() {
    let grown = SHADERS[1].replace("visibility: f32,", "visibility: f32,\n    more: f32,");
    assert_eq!(size("Vpl", &[&grown]), 64);
}

/// A shader below the plugin's `gi`.
fn shader(file: &str) -> String {
    let gi = frugal_tests::folder::workspace().join("plugin/src/gi");
    std::fs::read_to_string(gi.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// What a shader sets a constant to.
fn definition<'a>(name: &str, source: &'a str) -> &'a str {
    let start = format!("const {name}: ");
    let text = source.split(&start).nth(1).unwrap_or_else(|| panic!("no constant {name}"));
    text.split_once('=').and_then(|(_, rest)| rest.split(';').next()).expect("a value").trim()
}

/// A number, or the value of a constant of the file.
fn factor(text: &str, source: &str) -> u64 {
    let number = text.trim().trim_end_matches('u').parse();
    number.unwrap_or_else(|_| value(text.trim(), source))
}

/// The value of an integer constant: a product of numbers and of other constants of the file.
fn value(name: &str, source: &str) -> u64 {
    definition(name, source).split('*').map(|text| factor(text, source)).product()
}

fn constants_are_those_of_the_plugin() {
    for (file, name, assumed) in SHADER_CONSTANTS {
        assert_eq!(value(name, &shader(file)), assumed, "{name} of {file}");
    }
    assert_eq!(value("A", "const A: u32 = B * 4u;\nconst B: u32 = 8u;"), 32, "products are read");
}

/// Every shader of a folder and of those below it.
fn shaders(folder: PathBuf) -> Vec<PathBuf> {
    let files =
        std::fs::read_dir(folder).expect("a folder").map(|file| file.expect("a file").path());
    files
        .flat_map(|file| if file.is_dir() { shaders(file) } else { vec![file] })
        .filter(|file| file.extension().is_some_and(|extension| extension == "wgsl"))
        .collect()
}

fn no_workgroup_has_more_threads_than_the_required_limits() {
    let imported = shader("vpl/vpl.wgsl");
    let mut largest: u64 = 0;
    for file in shaders(frugal_tests::folder::workspace().join("plugin/src/gi")) {
        let source = std::fs::read_to_string(&file).expect("a shader") + &imported;
        for size in source.split("@workgroup_size(").skip(1) {
            let size = size.split(')').next().expect("a size");
            largest = largest.max(size.split(',').map(|side| factor(side, &source)).product());
        }
    }
    let limits = GiPlugin::required_limits();
    assert_eq!(largest, u64::from(limits.max_compute_invocations_per_workgroup));
    assert!(largest <= u64::from(limits.max_compute_workgroup_size_x), "in one row");
}
