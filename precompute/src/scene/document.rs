//! What a glTF file asks for and Bevy's loader does not read. The loader itself only logs it, or
//! says that the file is invalid.

use std::collections::BTreeSet;

use bevy_frugal_gi::stage::extract::gap_line;
use gltf::accessor::{DataType, Dimensions};
use gltf::json::validation::{Error, Validate};
use gltf::json::{Path, Root};
use gltf::{Document, Gltf, Semantic};
use percent_encoding::percent_decode_str;

/// Extensions that Bevy's loader reads, or that are nothing to an image.
const READ: [&str; 12] = [
    "KHR_lights_punctual",
    "KHR_materials_unlit",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_ior",
    "KHR_materials_emissive_strength",
    "KHR_materials_clearcoat",
    "KHR_materials_specular",
    "KHR_materials_anisotropy",
    "KHR_texture_transform",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];
/// Extensions of materials that may be required: without them a file still has all its surfaces.
const OPTIONAL: &str = "KHR_materials_";
/// Required by files with integers as positions, which are refused one by one.
const QUANTIZATION: &str = "KHR_mesh_quantization";
/// Extensions that give a texture another image.
const IMAGES: [&str; 3] = ["EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"];

/// A valid file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Checked {
    /// Number of its scene.
    pub(super) scene: usize,
    /// What is left out, as sentences.
    pub(super) gaps: Vec<String>,
}

/// Checks the file of `bytes`, without its buffers and images.
///
/// # Errors
/// Why it cannot be loaded.
pub(super) fn check(bytes: &[u8]) -> Result<Checked, String> {
    if let Some(header) = bytes.strip_prefix(b"glTF") {
        let length = header.get(4..8).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
        let (expected, found) = (length.map_or(12, u64::from), bytes.len() as u64);
        if found < expected {
            return Err(format!("it is cut short: {found} bytes of {expected}"));
        }
    }
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes)
        .map_err(|error| format!("it is not a glTF 2.0 file: {error}"))?;
    let root = document.into_json();
    if let (Some(buffer), Some(blob)) = (root.buffers.first(), blob)
        && buffer.uri.is_none()
        && buffer.byte_length.0 > blob.len() as u64
    {
        return Err(format!("buffer 0 has {} bytes of {}", blob.len(), buffer.byte_length.0));
    }
    for name in &root.extensions_required {
        let is_readable =
            READ.contains(&name.as_str()) || name.starts_with(OPTIONAL) || name == QUANTIZATION;
        if !is_readable {
            return Err(format!(
                "it requires the extension {name}, which Bevy's loader does not read; write it \
                 without, for example by `gltf-transform copy`"
            ));
        }
    }
    if let Some(problem) = invalid(&root) {
        return Err(problem);
    }
    let document = Document::from_json_without_validation(root);
    let mut gaps = Vec::new();
    extensions(&document, &mut gaps);
    attributes(&document, &mut gaps)?;
    texture_uses(&document, &mut gaps);
    let lights = document.nodes().filter(|node| node.light().is_some()).count();
    for (count, what) in [(lights, "lights"), (document.animations().count(), "animations")] {
        if count > 0 {
            gaps.push(format!("{count} {what} of the file are left out"));
        }
    }
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let scene = scene.ok_or("it has no scene")?.index();
    Ok(Checked { scene, gaps })
}

/// Names of the buffers and images beside the file of `bytes`, as paths from its folder; none where it is
/// no glTF file.
pub(super) fn files(bytes: &[u8]) -> Vec<String> {
    let Ok(Gltf { document, .. }) = Gltf::from_slice_without_validation(bytes) else {
        return Vec::new();
    };
    let root = document.into_json();
    let buffers = root.buffers.iter().filter_map(|buffer| buffer.uri.as_deref());
    let images = root.images.iter().filter_map(|image| image.uri.as_deref());
    buffers.chain(images).filter_map(beside).collect()
}

/// The first buffer beside the file of `bytes`, in `folder`, that is shorter than that file says, as a
/// sentence. Bevy's loader would draw what is left of it, without the missing indices.
pub(super) fn short_buffer(bytes: &[u8], folder: &std::path::Path) -> Option<String> {
    let root = Gltf::from_slice_without_validation(bytes).ok()?.document.into_json();
    root.buffers.iter().find_map(|buffer| {
        let name = beside(buffer.uri.as_deref()?)?;
        // One that is missing is the loader's to name.
        let found = std::fs::metadata(folder.join(&name)).ok()?.len();
        let expected = buffer.byte_length.0;
        (found < expected).then(|| {
            format!("its buffer {name} is cut short or not downloaded: {found} bytes of {expected}")
        })
    })
}

/// The path of a file beside a glTF file; `None` of data in the file itself.
fn beside(uri: &str) -> Option<String> {
    let path = || percent_decode_str(uri).decode_utf8_lossy().into_owned();
    (!uri.starts_with("data:")).then(path)
}

/// The first contradiction in the file.
fn invalid(root: &Root) -> Option<String> {
    // What follows assumes that these are valid.
    let attributes = root
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .flat_map(|primitive| primitive.attributes.values());
    let count = root.accessors.len();
    if let Some(index) = attributes.map(gltf::json::Index::value).find(|index| *index >= count) {
        return Some(format!("an attribute names accessor {index} of {count}"));
    }
    for (index, texture) in root.textures.iter().enumerate() {
        if texture.source.value() >= root.images.len() {
            let others = texture.extensions.as_ref().map(|all| all.others.keys());
            let other =
                others.and_then(|mut names| names.find(|name| IMAGES.contains(&name.as_str())));
            return Some(match other {
                Some(name) => format!(
                    "texture {index} has an image by {name} alone, which Bevy's loader does not \
                     read; convert it to PNG or JPEG"
                ),
                None => format!("texture {index} has no image"),
            });
        }
    }
    let mut first = None;
    root.validate(root, Path::new, &mut |path: &dyn Fn() -> Path, error: Error| {
        let path = path().to_string();
        // Required extensions are checked above; a view that is missing stands for zeros.
        let is_checked = path.starts_with("extensionsRequired")
            || (path.starts_with("accessors")
                && path.ends_with("bufferView")
                && error == Error::Missing);
        if !is_checked {
            first
                .get_or_insert_with(|| format!("it is not a valid glTF 2.0 file: {path}: {error}"));
        }
    });
    first
}

fn extensions(document: &Document, gaps: &mut Vec<String>) {
    let is_ignored =
        |name: &&str| !READ.contains(name) && *name != QUANTIZATION && !IMAGES.contains(name);
    let ignored: Vec<&str> = document.extensions_used().filter(is_ignored).collect();
    if !ignored.is_empty() {
        gaps.push(format!("extensions that Bevy's loader does not read: {}", ignored.join(", ")));
    }
}

/// Attributes that the loader drops.
fn attributes(document: &Document, gaps: &mut Vec<String>) -> Result<(), String> {
    let mut dropped = BTreeSet::new();
    for mesh in document.meshes() {
        let name = || mesh.name().map_or_else(|| format!("mesh {}", mesh.index()), str::to_owned);
        for (semantic, accessor) in
            mesh.primitives().flat_map(|primitive| primitive.attributes().collect::<Vec<_>>())
        {
            // Tangents are for normal maps, which are not traced.
            let format = (accessor.data_type(), accessor.dimensions(), accessor.normalized());
            let is_present = accessor.view().is_some() || accessor.sparse().is_some();
            if is_present && is_read(&semantic, format) {
                continue;
            }
            if semantic == Semantic::Positions {
                return Err(format!(
                    "positions of {} are not vectors of 32-bit floats, the only ones that Bevy's \
                     loader reads ({QUANTIZATION}: write it without, for example by \
                     `gltf-transform dequantize`)",
                    name()
                ));
            }
            dropped.insert(format!("{} of {}", semantic.to_string(), name()));
        }
    }
    gaps.extend(gap_line("attributes that Bevy's loader does not read", &dropped));
    Ok(())
}

/// Whether Bevy's loader reads an attribute of this format, and whether its values are normalised.
fn is_read(semantic: &Semantic, format: (DataType, Dimensions, bool)) -> bool {
    use DataType::{F32, U8, U16};
    use Dimensions::{Vec2, Vec3, Vec4};
    match semantic {
        Semantic::Positions | Semantic::Normals => matches!(format, (F32, Vec3, false)),
        Semantic::Tangents => matches!(format, (F32, Vec4, false)),
        Semantic::TexCoords(0 | 1) => matches!(format, (F32, Vec2, false) | (U8 | U16, Vec2, true)),
        Semantic::Colors(0) => {
            matches!(format, (F32, Vec3 | Vec4, false) | (U8 | U16, Vec3 | Vec4, true))
        }
        Semantic::Joints(0) => matches!(format, (U8 | U16, Vec4, false)),
        Semantic::Weights(0) => matches!(format, (F32, Vec4, false) | (U8 | U16, Vec4, true)),
        // Names of the author's own, for shaders of the author's own.
        Semantic::Extras(_) => true,
        _ => false,
    }
}

/// Texture coordinates that the loader does not follow.
fn texture_uses(document: &Document, gaps: &mut Vec<String>) {
    let (mut unread, mut moved) = (BTreeSet::new(), BTreeSet::new());
    for material in document.materials() {
        let surface = material.pbr_metallic_roughness();
        let base = surface.base_color_texture();
        let others = [surface.metallic_roughness_texture(), material.emissive_texture()];
        let name = || {
            let number = material.index().unwrap_or_default();
            material.name().map_or_else(|| format!("material {number}"), str::to_owned)
        };
        let is_unread = |info: &gltf::texture::Info| {
            let other = info.texture_transform().and_then(|transform| transform.tex_coord());
            info.tex_coord() > 1 || other.is_some_and(|other| other != info.tex_coord())
        };
        if base.iter().chain(others.iter().flatten()).any(is_unread) {
            unread.insert(name());
        }
        let expected = movement(base.as_ref());
        if others.iter().flatten().any(|info| movement(Some(info)) != expected) {
            moved.insert(name());
        }
    }
    let what = "Bevy's loader does not read the texture coordinates of a texture of";
    gaps.extend(gap_line(what, &unread));
    gaps.extend(gap_line("Bevy moves all textures as the base colour's in", &moved));
}

/// Offset, rotation and scale of a texture. A transform that changes nothing is as good as none.
fn movement(texture: Option<&gltf::texture::Info>) -> ([f32; 2], f32, [f32; 2]) {
    texture
        .and_then(|texture| texture.texture_transform())
        .map_or(([0.0; 2], 0.0, [1.0; 2]), |transform| {
            (transform.offset(), transform.rotation(), transform.scale())
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(rest: &str) -> Vec<u8> {
        format!(r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[]}}]{rest}}}"#).into_bytes()
    }

    #[test]
    fn required_extensions_are_read_ignored_or_named() {
        for name in ["KHR_texture_transform", "KHR_materials_variants", "KHR_xmp_json_ld"] {
            let json = format!(r#","extensionsUsed":["{name}"],"extensionsRequired":["{name}"]"#);
            let checked = check(&file(&json)).expect(name);
            let is_said = checked.gaps.iter().any(|gap| gap.contains(name));
            assert_eq!(is_said, name == "KHR_materials_variants", "{:?}", checked.gaps);
        }
        for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_texture_webp"] {
            let json = format!(r#","extensionsUsed":["{name}"],"extensionsRequired":["{name}"]"#);
            let error = check(&file(&json)).expect_err(name);
            assert!(error.contains(name) && !error.contains("valid"), "{error}");
        }
        let used = check(&file(r#","extensionsUsed":["EXT_mesh_gpu_instancing"]"#)).expect("used");
        assert!(used.gaps[0].contains("EXT_mesh_gpu_instancing"), "{:?}", used.gaps);
    }

    #[test]
    fn many_names_are_counted() {
        let mesh = r#"{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_2":1}}]}"#;
        let material = r#"{"emissiveTexture":{"index":0,"texCoord":2}}"#;
        let json = format!(
            r#","meshes":[{}],"materials":[{}],"textures":[{{"source":0}}],"images":[{{"uri":"a.png"}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
             {{"bufferView":0,"componentType":5126,"count":3,"type":"VEC2"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"uri":"a.bin","byteLength":36}}]"#,
            [mesh; 7].join(","),
            [material; 7].join(",")
        );
        let gaps = check(&file(&json)).expect("a valid file").gaps;
        let is_short = |gap: &String| gap.ends_with(" 4 and 2 more");
        assert!(gaps.len() == 2 && gaps.iter().all(is_short), "{gaps:?}");
    }

    #[test]
    fn textures_without_an_image_are_named() {
        let webp = r#","images":[{"uri":"a.webp"}],"extensionsUsed":["EXT_texture_webp"],
            "textures":[{"extensions":{"EXT_texture_webp":{"source":0}}}]"#;
        let error = check(&file(webp)).expect_err("no image that is read");
        assert!(error.contains("EXT_texture_webp"), "{error}");
        let fallback = webp.replace("{\"extensions\"", "{\"source\":0,\"extensions\"");
        assert!(check(&file(&fallback)).is_ok());
        assert!(check(&file(r#","textures":[{}]"#)).expect_err("no image").contains("texture 0"));
    }

    #[test]
    fn broken_files_are_refused() {
        assert!(check(b"").is_err() && check(b"no").is_err() && check(b"glTF").is_err());
        assert!(check(&file(r#","scene":3"#)).is_err());
        assert!(check(br#"{"asset":{"version":"2.0"}}"#).expect_err("empty").contains("no scene"));
        let mesh = r#","meshes":[{"primitives":[{"attributes":{"POSITION":7}}]}]"#;
        assert!(check(&file(mesh)).expect_err("no accessor").contains("accessor 7 of 0"));
    }
}
