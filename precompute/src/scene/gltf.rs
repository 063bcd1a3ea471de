//! Geometry from a `.glb` or `.gltf` file. Never panics, however broken the file.
//!
//! Reads every triangle primitive of the default scene (lists, strips and fans) with its node's
//! transform, `POSITION`, `NORMAL`, `TEXCOORD_0`, `COLOR_0`, base colour with its texture,
//! roughness, metallic, the specular factor of `KHR_materials_specular`, emission (its unitless
//! factor is interpreted as nits), alpha mask, and double-sidedness. Skins stay in their bind pose.
//! Blended materials become opaque. Cameras, lights and animations are left out.

use std::path::Path;

use frugal_trace::scene::{AlphaMode, SceneGeometry, SceneMaterial, SceneMesh, SceneTexture};
use glam::{Mat3, Mat4, Vec2, Vec3};
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;
use gltf::{Gltf, Primitive, Semantic};

pub(crate) use super::gltf_buffers::GltfError;
use super::gltf_buffers::{Buffers, read_uri};

/// Greatest number of triangles: nodes can repeat a mesh without limit, and memory is limited.
const GREATEST_TRIANGLE_COUNT: usize = 50_000_000;

/// Reads the geometry of the file at `path`. Unsupported parts are listed in
/// [`SceneGeometry::warnings`].
///
/// # Errors
/// [`GltfError`], when the file is missing, broken or without a triangle.
pub(crate) fn load(path: &Path) -> Result<SceneGeometry, GltfError> {
    let bytes = std::fs::read(path)
        .map_err(|source| GltfError::Unreadable { file: path.to_path_buf(), source })?;
    parse(&bytes, path)
}

/// As [`load`], from the file's bytes; files that it names are relative to `path`.
///
/// # Errors
/// As [`load`].
pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<SceneGeometry, GltfError> {
    let (file, buffers) = open(bytes, path)?;
    let mut geometry = SceneGeometry::default();
    let textures: Vec<Option<usize>> = file
        .textures()
        .map(|texture| {
            let cutoff = cutoff_of(&file, &texture);
            decode_texture(&texture, &buffers, path, cutoff, &mut geometry)
        })
        .collect();
    geometry.materials =
        file.materials().map(|material| convert_material(&material, &textures)).collect();
    // The last stands for "no material".
    geometry.materials.push(SceneMaterial { metallic: 0.0, ..SceneMaterial::default() });
    add_nodes(&file, &buffers, &mut geometry)?;
    if geometry.triangle_count() == 0 {
        return Err(GltfError::Broken("it has no triangles".into()));
    }
    Ok(geometry)
}

/// The bytes of every buffer of the file, in order: with the file's own bytes, they determine its
/// geometry.
pub(super) fn buffer_contents(bytes: &[u8], path: &Path) -> Result<Vec<Vec<u8>>, GltfError> {
    let (_, buffers) = open(bytes, path)?;
    Ok(buffers.iter().map(<[u8]>::to_vec).collect())
}

fn open(bytes: &[u8], path: &Path) -> Result<(Gltf, Buffers), GltfError> {
    if let Some(header) = bytes.strip_prefix(b"glTF") {
        let word = |at: usize| {
            header.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes)
        };
        let (expected, found) = (word(4).map_or(12, u64::from), bytes.len() as u64);
        if found < expected {
            return Err(GltfError::Truncated { expected, found });
        }
    }
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes)?;
    let root = document.into_json();
    // The crate's own validation assumes that these indices are valid, and panics where they are
    // not.
    let attributes = root
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .flat_map(|primitive| primitive.attributes.values());
    if let Some(index) =
        attributes.map(|index| index.value()).find(|index| *index >= root.accessors.len())
    {
        return Err(GltfError::Broken(format!(
            "an attribute names accessor {index} of {}",
            root.accessors.len()
        )));
    }
    let file = Gltf { document: gltf::Document::from_json(root)?, blob };
    let buffers = Buffers::read(&file, path)?;
    Ok((file, buffers))
}

fn add_nodes(
    file: &Gltf,
    buffers: &Buffers,
    geometry: &mut SceneGeometry,
) -> Result<(), GltfError> {
    let mut pending: Vec<(gltf::Node, Mat4)> =
        match file.default_scene().or_else(|| file.scenes().next()) {
            Some(scene) => scene.nodes().map(|node| (node, Mat4::IDENTITY)).collect(),
            None => return Err(GltfError::Broken("it has no scene".into())),
        };
    let mut visited = vec![false; file.nodes().len()];
    // An explicit stack, because a chain of nodes can exceed the program's stack.
    while let Some((node, parent)) = pending.pop() {
        if std::mem::replace(&mut visited[node.index()], true) {
            return Err(GltfError::Broken(format!(
                "node {} has two parents, or is its own ancestor",
                node.index()
            )));
        }
        // A skinned mesh is placed by its joints, in bind pose at the origin, and not by its node.
        let transform = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        let placement = if node.skin().is_some() { Mat4::IDENTITY } else { transform };
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            if let Some(mesh) = convert_primitive(&primitive, buffers, placement, geometry)? {
                geometry.meshes.push(mesh);
            }
            if geometry.triangle_count() > GREATEST_TRIANGLE_COUNT {
                return Err(GltfError::Unsupported(format!(
                    "it has more than {GREATEST_TRIANGLE_COUNT} triangles"
                )));
            }
        }
        pending.extend(node.children().map(|child| (child, transform)));
    }
    Ok(())
}

fn convert_primitive(
    primitive: &Primitive,
    buffers: &Buffers,
    placement: Mat4,
    geometry: &mut SceneGeometry,
) -> Result<Option<SceneMesh>, GltfError> {
    let mode = primitive.mode();
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        geometry
            .warnings
            .push(format!("primitive {} is made of {mode:?} and is left out", primitive.index()));
        return Ok(None);
    }
    let Some(accessor) = primitive.get(&Semantic::Positions) else { return Ok(None) };
    let positions: Vec<Vec3> = buffers
        .vectors::<3>(&accessor, &[Dimensions::Vec3])?
        .into_iter()
        .map(Vec3::from_array)
        .collect();
    let count = positions.len();
    let complete = |found: usize, what: &str| {
        let problem =
            || GltfError::Broken(format!("a primitive has {count} positions but {found} {what}"));
        (found == count).then_some(()).ok_or_else(problem)
    };
    let order = match primitive.indices() {
        Some(accessor) => buffers.indices(&accessor)?,
        None => (0..count as u32).collect(),
    };
    if let Some(index) = order.iter().find(|index| **index as usize >= count) {
        return Err(GltfError::Broken(format!(
            "an index is {index} where there are {count} positions"
        )));
    }
    // What stays in place keeps every bit, signs of zeros too.
    let is_moved = placement != Mat4::IDENTITY;
    let placed = |position| {
        if is_moved { placement.transform_point3(position) } else { position }
    };
    let mut mesh = SceneMesh {
        positions: positions.into_iter().map(placed).collect(),
        uvs: vec![Vec2::ZERO; count],
        colors: vec![[1.0; 4]; count],
        indices: triangle_list(mode, &order),
        material: primitive.material().index().unwrap_or(geometry.materials.len() - 1),
        ..SceneMesh::default()
    };
    if !mesh.positions.iter().all(|position| position.is_finite()) {
        return Err(GltfError::Broken("a position is not finite".into()));
    }
    // A mirroring transform flips triangles; the glTF specification flips the winding in turn.
    let linear = Mat3::from_mat4(placement);
    let determinant = linear.determinant();
    if determinant < 0.0 {
        mesh.indices.chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
    }
    if let Some(accessor) = primitive.get(&Semantic::TexCoords(0)) {
        mesh.uvs = buffers
            .vectors::<2>(&accessor, &[Dimensions::Vec2])?
            .into_iter()
            .map(Vec2::from_array)
            .collect();
        complete(mesh.uvs.len(), "texture coordinates")?;
    }
    if let Some(accessor) = primitive.get(&Semantic::Colors(0)) {
        mesh.colors = buffers.vectors::<4>(&accessor, &[Dimensions::Vec3, Dimensions::Vec4])?;
        complete(mesh.colors.len(), "colours")?;
    }
    let given = match primitive.get(&Semantic::Normals) {
        Some(accessor) => Some(buffers.vectors::<3>(&accessor, &[Dimensions::Vec3])?),
        None => None,
    };
    match given {
        // The cofactor matrix transforms normals without an inverse, and so handles singular
        // transforms.
        Some(normals) => {
            complete(normals.len(), "normals")?;
            let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
            let cofactor =
                Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * determinant.signum();
            let turned = |normal| if is_moved { cofactor * normal } else { normal };
            mesh.normals = normals
                .into_iter()
                .map(|normal| turned(Vec3::from_array(normal)).normalize_or(Vec3::Y))
                .collect();
        }
        None => flatten(&mut mesh),
    }
    Ok(Some(mesh))
}

/// Strips and fans as lists, with the winding that the glTF specification gives each.
fn triangle_list(mode: Mode, order: &[u32]) -> Vec<u32> {
    match mode {
        Mode::TriangleStrip => order
            .windows(3)
            .enumerate()
            .flat_map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        Mode::TriangleFan if order.len() >= 3 => {
            order[1..].windows(2).flat_map(|pair| [order[0], pair[0], pair[1]]).collect()
        }
        Mode::TriangleFan => Vec::new(),
        _ => order[..order.len() / 3 * 3].to_vec(),
    }
}

/// Flat normals, as the glTF specification requires where normals are missing: each triangle gets
/// its own vertices.
fn flatten(mesh: &mut SceneMesh) {
    let each = |i: &u32| *i as usize;
    let positions: Vec<Vec3> = mesh.indices.iter().map(|i| mesh.positions[each(i)]).collect();
    mesh.uvs = mesh.indices.iter().map(|i| mesh.uvs[each(i)]).collect();
    mesh.colors = mesh.indices.iter().map(|i| mesh.colors[each(i)]).collect();
    mesh.normals = positions
        .chunks_exact(3)
        .flat_map(|corners| {
            [(corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(Vec3::Y); 3]
        })
        .collect();
    mesh.indices = (0..positions.len() as u32).collect();
    mesh.positions = positions;
}

fn clamped(value: f32, least: f32, greatest: f32) -> f32 {
    if value.is_finite() { value.clamp(least, greatest) } else { least }
}

/// The cutoff of a material with an alpha mask.
fn cutoff(material: &gltf::Material) -> Option<f32> {
    let has_mask = material.alpha_mode() == gltf::material::AlphaMode::Mask;
    has_mask.then(|| clamped(material.alpha_cutoff().unwrap_or(0.5), 0.0, 1.0))
}

/// The cutoff of the first material with an alpha mask that uses `texture`.
fn cutoff_of(file: &Gltf, texture: &gltf::Texture) -> Option<f32> {
    file.materials().find_map(|material| {
        let used = material.pbr_metallic_roughness().base_color_texture()?.texture();
        cutoff(&material).filter(|_| used.index() == texture.index())
    })
}

fn convert_material(material: &gltf::Material, textures: &[Option<usize>]) -> SceneMaterial {
    let surface = material.pbr_metallic_roughness();
    let texture = surface
        .base_color_texture()
        .and_then(|info| textures.get(info.texture().index()).copied().flatten());
    SceneMaterial {
        base_color: surface.base_color_factor().map(|value| clamped(value, 0.0, 1.0)),
        perceptual_roughness: clamped(surface.roughness_factor(), 0.0, 1.0),
        metallic: clamped(surface.metallic_factor(), 0.0, 1.0),
        // As in Bevy, which halves the factor.
        reflectance: 0.5
            * material
                .extension_value("KHR_materials_specular")
                .and_then(|specular| specular["specularFactor"].as_f64())
                .map_or(1.0, |factor| clamped(factor as f32, 0.0, 1.0)),
        emissive: material.emissive_factor().map(|value| {
            clamped(value * material.emissive_strength().unwrap_or(1.0), 0.0, f32::MAX)
        }),
        alpha: cutoff(material).map_or(AlphaMode::Opaque, AlphaMode::Mask),
        double_sided: material.double_sided(),
        base_color_texture: texture,
    }
}

/// Decodes a texture into `geometry`, with the coverage of an alpha mask of `cutoff`, or adds a warning that it is left out.
fn decode_texture(
    texture: &gltf::Texture,
    buffers: &Buffers,
    path: &Path,
    cutoff: Option<f32>,
    geometry: &mut SceneGeometry,
) -> Option<usize> {
    let image = texture.source();
    let bytes = match image.source() {
        gltf::image::Source::View { view, .. } => buffers.view(&view).map(<[u8]>::to_vec),
        gltf::image::Source::Uri { uri, .. } => read_uri(uri, path),
    };
    let decoded = bytes.map_err(|error| error.to_string()).and_then(|bytes| {
        let picture =
            image::load_from_memory(&bytes).map_err(|error| error.to_string())?.into_rgba8();
        let (width, height) = picture.dimensions();
        SceneTexture::from_rgba8(width, height, picture.into_raw(), cutoff)
            .ok_or_else(|| "it is empty".to_owned())
    });
    match decoded {
        Ok(texture) => {
            geometry.textures.push(texture);
            Some(geometry.textures.len() - 1)
        }
        Err(problem) => {
            geometry.warnings.push(format!("texture {} is left out: {problem}", texture.index()));
            None
        }
    }
}

#[cfg(test)]
#[path = "gltf_tests.rs"]
pub(super) mod tests;
