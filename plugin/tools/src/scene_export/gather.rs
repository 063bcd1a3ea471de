//! What an app shows, as plain data.

use std::collections::HashMap;
use std::fmt;
use std::io::Cursor;

use bevy::asset::AssetId;
use bevy::camera::Exposure;
use bevy::camera::visibility::{RenderLayers, VisibilityRange};
use bevy::ecs::query::QueryItem;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::light::{AmbientLight, EnvironmentMapLight, GlobalAmbientLight};
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy::render::render_resource::Face;
use bevy_frugal_gi::gi::{FrugalGi, RsmView};
use image::ImageFormat;

use super::description::{Bounds, Environment, Geometry, Lens, LightData, SceneFile, paths};
use super::glb::{GeometryData, Instance, MaterialData, MeshData};
use super::tour::Key;

/// The lens of a camera without a perspective one, as Bevy's default: degrees and metres.
const LENS: (f32, f32, f32) = (45.0, 0.1, 1000.0);
/// Space around cameras within the bounds, metres.
const MARGIN: f32 = 0.5;

type Surface = (
    &'static Mesh3d,
    &'static MeshMaterial3d<StandardMaterial>,
    &'static GlobalTransform,
    Option<&'static InheritedVisibility>,
    Option<&'static RenderLayers>,
    Option<&'static VisibilityRange>,
    Has<SkinnedMesh>,
);

type View = (
    Entity,
    &'static Camera,
    &'static GlobalTransform,
    &'static Projection,
    Option<&'static Exposure>,
    Option<&'static RenderLayers>,
    Option<&'static AmbientLight>,
    Has<EnvironmentMapLight>,
    Has<FrugalGi>,
);

type IsShown = Option<&'static InheritedVisibility>;

/// Numbers of meshes that are not exported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LeftOut {
    pub skinned: usize,
    pub transparent: usize,
    pub other_materials: usize,
    pub unreadable: usize,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} skinned, {} transparent, {} of other materials, {} unreadable",
            self.skinned, self.transparent, self.other_materials, self.unreadable
        )
    }
}

/// The app's scene.
#[derive(SystemParam)]
pub(super) struct SceneQuery<'w, 's> {
    meshes: Res<'w, Assets<Mesh>>,
    materials: Res<'w, Assets<StandardMaterial>>,
    images: Res<'w, Assets<Image>>,
    ambient: Option<Res<'w, GlobalAmbientLight>>,
    surfaces: Query<'w, 's, Surface>,
    others: Query<'w, 's, (), (With<Mesh3d>, Without<MeshMaterial3d<StandardMaterial>>)>,
    directional: Query<'w, 's, (&'static DirectionalLight, &'static GlobalTransform, IsShown)>,
    points: Query<'w, 's, (&'static PointLight, &'static GlobalTransform, IsShown)>,
    spots: Query<'w, 's, (&'static SpotLight, &'static GlobalTransform, IsShown)>,
    cameras: Query<'w, 's, View, (With<Camera3d>, Without<RsmView>)>,
}

impl SceneQuery<'_, '_> {
    fn active(&self) -> impl Iterator<Item = QueryItem<'_, '_, View>> {
        self.cameras.iter().filter(|(_, camera, ..)| camera.is_active)
    }

    /// The exported camera: an active one, with global illumination if there is any.
    fn camera(&self) -> Option<QueryItem<'_, '_, View>> {
        self.active().find(|view| view.8).or_else(|| self.active().next())
    }

    pub(super) fn main_camera(&self) -> Option<Entity> {
        self.camera().map(|(camera, ..)| camera)
    }

    pub(super) fn active_cameras(&self) -> impl Iterator<Item = (Entity, &GlobalTransform)> {
        self.active().map(|(entity, _, at, ..)| (entity, at))
    }

    /// Every mesh that an active camera can show, in its place.
    pub(super) fn geometry(&self) -> (GeometryData, LeftOut) {
        let layers: Vec<RenderLayers> =
            self.active().map(|view| view.5.cloned().unwrap_or_default()).collect();
        let exposure = exposure(self.exposure_ev100());
        let mut found = GeometryData::default();
        let mut left_out = LeftOut { other_materials: self.others.iter().count(), ..default() };
        let mut meshes: HashMap<AssetId<Mesh>, Option<usize>> = HashMap::new();
        let mut materials = HashMap::new();
        let mut textures = HashMap::new();
        for (mesh, material, transform, visibility, own_layers, range, is_skinned) in &self.surfaces
        {
            let own_layers = own_layers.cloned().unwrap_or_default();
            let is_visible = visibility.is_none_or(|visibility| visibility.get())
                && layers.iter().any(|layers| layers.intersects(&own_layers))
                // The level of detail of a near camera.
                && range.is_none_or(|range| range.start_margin.start <= 0.0);
            let Some(surface) = self.materials.get(&material.0).filter(|_| is_visible) else {
                continue;
            };
            let is_solid = matches!(surface.alpha_mode, AlphaMode::Opaque | AlphaMode::Mask(_));
            match (is_skinned, is_solid) {
                (true, _) => left_out.skinned += 1,
                (_, false) => left_out.transparent += 1,
                _ => {
                    let mesh = *meshes.entry(mesh.id()).or_insert_with(|| {
                        let data = mesh_data(self.meshes.get(&mesh.0)?)?;
                        found.meshes.push(data);
                        Some(found.meshes.len() - 1)
                    });
                    let transform = Mat4::from(transform.affine());
                    let Some(mesh) = mesh.filter(|_| transform.is_finite()) else {
                        left_out.unreadable += 1;
                        continue;
                    };
                    let material = *materials.entry(material.id()).or_insert_with(|| {
                        let texture = surface.base_color_texture.as_ref().and_then(|texture| {
                            *textures.entry(texture.id()).or_insert_with(|| {
                                found.images.push(png(self.images.get(texture)?)?);
                                Some(found.images.len() - 1)
                            })
                        });
                        found.materials.push(material_data(surface, texture, exposure));
                        found.materials.len() - 1
                    });
                    found.instances.push(Instance { mesh, material, transform });
                }
            }
        }
        (found, left_out)
    }

    fn exposure_ev100(&self) -> f32 {
        let exposure = self.camera().and_then(|view| view.4.copied()).unwrap_or_default();
        exposure.ev100
    }

    /// The scene's file, for `geometry` in the file `glb` beside it.
    pub(super) fn scene(
        &self,
        geometry: &GeometryData,
        glb: String,
        tours: &[Vec<Key>],
    ) -> SceneFile {
        let camera = self.camera();
        let (vertical_fov, near, far) = match camera.as_ref().map(|view| view.3) {
            Some(Projection::Perspective(lens)) => (lens.fov.to_degrees(), lens.near, lens.far),
            _ => LENS,
        };
        let ambient = camera
            .as_ref()
            .and_then(|view| view.6.map(|own| (own.color, own.brightness)))
            .or_else(|| self.ambient.as_ref().map(|all| (all.color, all.brightness)));
        SceneFile {
            geometry: Geometry::Gltf(glb),
            lights: self.lights(),
            environment: match ambient.map(|(color, nits)| scaled(color, nits)) {
                None | Some([0.0, 0.0, 0.0]) => Environment::None,
                Some(ambient) => Environment::Constant(ambient),
            },
            exposure_ev100: self.exposure_ev100(),
            camera: Lens { vertical_fov, near, far },
            bounds: bounds(geometry, tours),
            paths: paths(tours),
            has_environment_map: camera.is_some_and(|view| view.7),
        }
    }

    fn lights(&self) -> Vec<LightData> {
        let is_shown = |shown: Option<&InheritedVisibility>, power: f32| {
            shown.is_none_or(|shown| shown.get()) && power.is_finite() && power > 0.0
        };
        let mut lights = Vec::new();
        for (light, at, shown) in &self.directional {
            if is_shown(shown, light.illuminance) {
                lights.push(LightData::Directional {
                    direction: at.forward().to_array(),
                    illuminance: light.illuminance,
                    color: scaled(light.color, 1.0),
                });
            }
        }
        for (light, at, shown) in &self.points {
            if is_shown(shown, light.intensity) {
                lights.push(LightData::Point {
                    position: at.translation().to_array(),
                    luminous_power: light.intensity,
                    range: light.range,
                    color: scaled(light.color, 1.0),
                });
            }
        }
        for (light, at, shown) in &self.spots {
            if is_shown(shown, light.intensity) {
                lights.push(LightData::Spot {
                    position: at.translation().to_array(),
                    direction: at.forward().to_array(),
                    luminous_power: light.intensity,
                    range: light.range,
                    inner_angle: light.inner_angle.min(light.outer_angle).to_degrees(),
                    outer_angle: light.outer_angle.to_degrees(),
                    color: scaled(light.color, 1.0),
                });
            }
        }
        lights
    }
}

fn scaled(color: Color, factor: f32) -> [f32; 3] {
    let color = LinearRgba::from(color);
    [color.red, color.green, color.blue].map(|value| (value * factor).max(0.0))
}

/// Factor from nits to the renderer's units.
fn exposure(ev100: f32) -> f32 {
    Exposure { ev100 }.exposure()
}

fn mesh_data(mesh: &Mesh) -> Option<MeshData> {
    let attribute = |attribute| mesh.try_attribute_option(attribute).ok().flatten();
    let Some(VertexAttributeValues::Float32x3(positions)) = attribute(Mesh::ATTRIBUTE_POSITION)
    else {
        return None;
    };
    let count = positions.len();
    let normals = match attribute(Mesh::ATTRIBUTE_NORMAL) {
        Some(VertexAttributeValues::Float32x3(normals)) if normals.len() == count => {
            normals.clone()
        }
        _ => Vec::new(),
    };
    let uvs = match attribute(Mesh::ATTRIBUTE_UV_0) {
        Some(VertexAttributeValues::Float32x2(uvs)) if uvs.len() == count => uvs.clone(),
        _ => Vec::new(),
    };
    let colors = match attribute(Mesh::ATTRIBUTE_COLOR) {
        Some(VertexAttributeValues::Float32x4(colors)) if colors.len() == count => colors.clone(),
        _ => Vec::new(),
    };
    let order: Vec<u32> = match mesh.try_indices_option().ok()? {
        Some(Indices::U16(indices)) => indices.iter().map(|index| u32::from(*index)).collect(),
        Some(Indices::U32(indices)) => indices.clone(),
        None => (0..count as u32).collect(),
    };
    let indices: Vec<u32> = match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => order[..order.len() / 3 * 3].to_vec(),
        PrimitiveTopology::TriangleStrip => order
            .windows(3)
            .enumerate()
            .flat_map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        _ => return None,
    };
    let is_valid = positions.iter().flatten().all(|value| value.is_finite())
        && indices.iter().all(|index| (*index as usize) < count)
        && !indices.is_empty();
    is_valid.then(|| MeshData { positions: positions.clone(), normals, uvs, colors, indices })
}

fn material_data(
    material: &StandardMaterial,
    texture: Option<usize>,
    exposure: f32,
) -> MaterialData {
    let color = LinearRgba::from(material.base_color);
    // An emission of weight 0 is in the renderer's units, one of weight 1 in nits.
    let weight = material.emissive_exposure_weight;
    let nits = (1.0 + weight * (exposure - 1.0)) / exposure;
    let emissive = [material.emissive.red, material.emissive.green, material.emissive.blue];
    MaterialData {
        base_color: color.to_f32_array().map(|value| value.clamp(0.0, 1.0)),
        roughness: material.perceptual_roughness.clamp(0.0, 1.0),
        metallic: material.metallic.clamp(0.0, 1.0),
        emissive: emissive.map(|value| {
            let value = value * nits;
            if value.is_finite() { value.max(0.0) } else { 0.0 }
        }),
        cutoff: match material.alpha_mode {
            AlphaMode::Mask(cutoff) => Some(cutoff.clamp(0.0, 1.0)),
            _ => None,
        },
        is_double_sided: material.cull_mode != Some(Face::Back),
        texture,
    }
}

/// `None` of a texture that the CPU cannot read.
fn png(image: &Image) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let image = image.clone().try_into_dynamic().ok()?.into_rgba8();
    image.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).ok()?;
    Some(bytes)
}

/// The box of geometry and cameras.
fn bounds(geometry: &GeometryData, tours: &[Vec<Key>]) -> Bounds {
    let corners = geometry.instances.iter().flat_map(|instance| {
        let mesh = &geometry.meshes[instance.mesh];
        mesh.positions
            .iter()
            .map(|position| instance.transform.transform_point3(Vec3::from_array(*position)))
    });
    let keys = tours.iter().flatten();
    let around = keys.flat_map(|key| [key.position - MARGIN, key.position + MARGIN]);
    let all: Vec<Vec3> = corners.chain(around).collect();
    let reduce = |pick: fn(Vec3, Vec3) -> Vec3| all.iter().copied().reduce(pick);
    // A floor alone has no height.
    let (min, max) = (reduce(Vec3::min).unwrap_or_default(), reduce(Vec3::max).unwrap_or_default());
    Bounds { min: min.to_array(), max: max.max(min + MARGIN).to_array() }
}
