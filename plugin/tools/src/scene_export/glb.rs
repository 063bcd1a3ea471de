//! Geometry as a binary glTF 2.0 file.

use bevy::math::{Mat4, Vec3};
use serde_json::{Value, json};

/// Accessor component types, and topologies, as glTF numbers them.
const U32: u32 = 5125;
const F32: u32 = 5126;

/// Triangles of one mesh asset, in its own space.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MeshData {
    pub positions: Vec<[f32; 3]>,
    /// One for each position, or none.
    pub normals: Vec<[f32; 3]>,
    /// One for each position, or none.
    pub uvs: Vec<[f32; 2]>,
    /// Linear RGBA; one for each position, or none.
    pub colors: Vec<[f32; 4]>,
    /// A multiple of three.
    pub indices: Vec<u32>,
}

/// A material, in glTF's terms.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MaterialData {
    /// Linear RGBA, 0 to 1.
    pub base_color: [f32; 4],
    pub roughness: f32,
    pub metallic: f32,
    /// Nits.
    pub emissive: [f32; 3],
    /// Alpha below which a fragment is discarded; `None`: opaque.
    pub cutoff: Option<f32>,
    pub is_double_sided: bool,
    /// Index into the images.
    pub texture: Option<usize>,
}

/// A mesh in a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instance {
    pub mesh: usize,
    pub material: usize,
    pub transform: Mat4,
}

/// Everything of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct GeometryData {
    pub meshes: Vec<MeshData>,
    pub materials: Vec<MaterialData>,
    /// PNG files.
    pub images: Vec<Vec<u8>>,
    pub instances: Vec<Instance>,
}

/// The binary part, and what describes it.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Index of a view of `bytes`.
    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        self.views.len() - 1
    }

    /// Index of an accessor; `None` of no values, which glTF does not allow.
    fn accessor<T: bytemuck::NoUninit>(
        &mut self,
        values: &[T],
        component: u32,
        kind: &str,
    ) -> Option<usize> {
        if values.is_empty() {
            return None;
        }
        let view = self.view(bytemuck::cast_slice(values));
        self.accessors.push(json!({
            "bufferView": view, "componentType": component, "count": values.len(), "type": kind
        }));
        Some(self.accessors.len() - 1)
    }

    /// Attributes and indices of a mesh, which instances with different materials share.
    fn mesh(&mut self, mesh: &MeshData) -> Value {
        let mut attributes = serde_json::Map::new();
        let mut add = |name: &str, accessor: Option<usize>| {
            if let Some(accessor) = accessor {
                attributes.insert(name.into(), accessor.into());
            }
        };
        let position = self.accessor(&mesh.positions, F32, "VEC3");
        // The format requires the range of positions.
        if let Some(accessor) = position.and_then(|index| self.accessors.get_mut(index)) {
            let points = || mesh.positions.iter().copied().map(Vec3::from_array);
            accessor["min"] = json!(points().reduce(Vec3::min).unwrap_or_default().to_array());
            accessor["max"] = json!(points().reduce(Vec3::max).unwrap_or_default().to_array());
        }
        add("POSITION", position);
        add("NORMAL", self.accessor(&mesh.normals, F32, "VEC3"));
        add("TEXCOORD_0", self.accessor(&mesh.uvs, F32, "VEC2"));
        add("COLOR_0", self.accessor(&mesh.colors, F32, "VEC4"));
        let indices = self.accessor(&mesh.indices, U32, "SCALAR");
        json!({ "attributes": attributes, "indices": indices })
    }
}

impl GeometryData {
    /// The file's bytes.
    pub(super) fn to_glb(&self) -> Vec<u8> {
        let mut buffer = Buffer::default();
        let primitives: Vec<Value> = self.meshes.iter().map(|mesh| buffer.mesh(mesh)).collect();
        let images: Vec<Value> = self
            .images
            .iter()
            .map(|png| json!({ "bufferView": buffer.view(png), "mimeType": "image/png" }))
            .collect();
        let textures: Vec<Value> =
            (0..images.len()).map(|source| json!({ "source": source, "sampler": 0 })).collect();

        // A glTF mesh has its material: one for each pair of both.
        let mut pairs: Vec<(usize, usize)> = Vec::new();
        let nodes: Vec<Value> = self
            .instances
            .iter()
            .map(|instance| {
                let pair = (instance.mesh, instance.material);
                let mesh = pairs.iter().position(|known| *known == pair).unwrap_or_else(|| {
                    pairs.push(pair);
                    pairs.len() - 1
                });
                json!({ "mesh": mesh, "matrix": instance.transform.to_cols_array() })
            })
            .collect();
        let meshes: Vec<Value> = pairs
            .iter()
            .map(|(mesh, material)| {
                let mut primitive = primitives[*mesh].clone();
                primitive["material"] = json!(material);
                json!({ "primitives": [primitive] })
            })
            .collect();

        let mut root = json!({
            "asset": { "version": "2.0", "generator": "bevy_frugal_gi" },
            "extensionsUsed": ["KHR_materials_emissive_strength"],
            "scene": 0,
            "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
            "nodes": nodes,
            "meshes": meshes,
            "materials": self.materials.iter().map(MaterialData::to_json).collect::<Vec<_>>(),
            "accessors": buffer.accessors,
            "bufferViews": buffer.views,
            "buffers": [{ "byteLength": buffer.bytes.len() }],
        });
        if !images.is_empty() {
            root["images"] = images.into();
            root["textures"] = textures.into();
            root["samplers"] = json!([{ "wrapS": 10497, "wrapT": 10497 }]);
        }
        assemble(&root, buffer.bytes)
    }
}

impl MaterialData {
    fn to_json(&self) -> Value {
        // Factors end at 1; the extension's strength has no end, and is in nits.
        let strength = self.emissive.into_iter().fold(0.0, f32::max);
        let mut surface = json!({
            "baseColorFactor": self.base_color,
            "metallicFactor": self.metallic,
            "roughnessFactor": self.roughness,
        });
        if let Some(texture) = self.texture {
            surface["baseColorTexture"] = json!({ "index": texture });
        }
        let mut material = json!({
            "pbrMetallicRoughness": surface,
            "doubleSided": self.is_double_sided,
        });
        if strength > 0.0 {
            material["emissiveFactor"] = json!(self.emissive.map(|value| value / strength));
            material["extensions"] =
                json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
        }
        if let Some(cutoff) = self.cutoff {
            material["alphaMode"] = "MASK".into();
            material["alphaCutoff"] = json!(cutoff);
        }
        material
    }
}

/// Header, JSON chunk and binary chunk.
fn assemble(root: &Value, bytes: Vec<u8>) -> Vec<u8> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + bytes.len();
    let mut file = Vec::with_capacity(length);
    let mut put = |part: &[u8]| file.extend_from_slice(part);
    put(b"glTF");
    put(&2_u32.to_le_bytes());
    put(&(length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bytes)] {
        put(&(chunk.len() as u32).to_le_bytes());
        put(kind);
        put(chunk);
    }
    file
}
