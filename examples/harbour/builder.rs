//! What the level is put together from: blocks, drums, roofs and lamps.

use bevy::light::NotShadowCaster;
use bevy::prelude::*;

use crate::surfaces::{Surfaces, in_metres};

type Surface = Handle<StandardMaterial>;

/// Light of a lamp, warm.
const LAMP: Color = Color::srgb(1.0, 0.68, 0.36);

/// Spawns meshes and lights.
pub(crate) struct Builder<'w, 's, 'a> {
    pub(crate) commands: Commands<'w, 's>,
    pub(crate) meshes: &'a mut Assets<Mesh>,
    pub(crate) surfaces: Surfaces,
}

impl Builder<'_, '_, '_> {
    fn mesh(&mut self, mesh: Mesh, surface: &Surface, place: Transform) -> Entity {
        let mesh = Mesh3d(self.meshes.add(in_metres(mesh)));
        self.commands.spawn((mesh, MeshMaterial3d(surface.clone()), place)).id()
    }

    /// A box.
    pub(crate) fn block(&mut self, size: Vec3, centre: Vec3, surface: &Surface) {
        self.turned(size, Transform::from_translation(centre), surface);
    }

    /// A box on the ground at `y`, between two corners in x and z.
    pub(crate) fn stand(&mut self, x: [f32; 2], z: [f32; 2], y: [f32; 2], surface: &Surface) {
        let size = vec3(x[1] - x[0], y[1] - y[0], z[1] - z[0]);
        self.block(size, vec3(x[0] + x[1], y[0] + y[1], z[0] + z[1]) / 2.0, surface);
    }

    /// A box anywhere.
    pub(crate) fn turned(&mut self, size: Vec3, place: Transform, surface: &Surface) {
        self.mesh(Cuboid::from_size(size).into(), surface, place);
    }

    /// An upright cylinder.
    pub(crate) fn drum(&mut self, radius: f32, height: f32, centre: Vec3, surface: &Surface) {
        let drum = Cylinder::new(radius, height).mesh().resolution(14).build();
        self.mesh(drum, surface, Transform::from_translation(centre));
    }

    /// A ball, squeezed to `radii`.
    pub(crate) fn ball(&mut self, radii: Vec3, centre: Vec3, surface: &Surface) {
        let ball = Sphere::new(1.0).mesh().uv(32, 16).scaled_by(radii);
        self.mesh(ball, surface, Transform::from_translation(centre));
    }

    /// A triangle of a width and height, drawn out along z by `depth`; its base's middle is at `place`.
    pub(crate) fn wedge(&mut self, size: Vec3, place: Transform, surface: &Surface) {
        let half = size.x / 2.0;
        let triangle = Triangle2d::new(vec2(-half, 0.0), vec2(half, 0.0), vec2(0.0, size.y));
        self.mesh(Extrusion::new(triangle, size.z).into(), surface, place);
    }

    /// A gabled roof over a rectangle; its ridge runs along the longer side.
    pub(crate) fn roof(&mut self, x: [f32; 2], z: [f32; 2], y: f32, surface: &Surface) {
        let middle = vec3((x[0] + x[1]) / 2.0, y, (z[0] + z[1]) / 2.0);
        let (width, depth) = (x[1] - x[0] + 0.8, z[1] - z[0] + 0.8);
        let place = Transform::from_translation(middle);
        if width > depth {
            let place = place.with_rotation(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2));
            self.wedge(vec3(depth, depth * 0.42, width), place, surface);
        } else {
            self.wedge(vec3(width, width * 0.42, depth), place, surface);
        }
    }

    /// The emissive part of a lamp, which its own light passes.
    pub(crate) fn bulb(&mut self, at: Vec3, radius: f32) {
        let surface = self.surfaces.bulb.clone();
        let ball = Sphere::new(radius).mesh().uv(12, 8);
        let bulb = self.mesh(ball, &surface, Transform::from_translation(at));
        self.commands.entity(bulb).insert(NotShadowCaster);
    }

    /// A lamp without shadows, below a bracket or on a post.
    pub(crate) fn lamp(&mut self, at: Vec3) {
        let iron = self.surfaces.iron.clone();
        self.block(vec3(0.3, 0.06, 0.3), at + Vec3::Y * 0.24, &iron);
        self.bulb(at, 0.11);
        let light = PointLight { color: LAMP, intensity: 12_000.0, range: 13.0, ..default() };
        self.commands.spawn((light, Transform::from_translation(at - Vec3::Y * 0.1)));
    }

    /// A lamp on a post on the ground.
    pub(crate) fn post(&mut self, ground: Vec3) {
        let iron = self.surfaces.iron.clone();
        self.drum(0.06, 3.4, ground + Vec3::Y * 1.7, &iron);
        self.lamp(ground + Vec3::Y * 3.55);
    }

    /// A lantern with a hood, which lights a cone below itself and casts shadows.
    pub(crate) fn lantern(&mut self, at: Vec3, towards: Vec3) {
        let iron = self.surfaces.iron.clone();
        self.drum(0.18, 0.12, at + Vec3::Y * 0.2, &iron);
        self.bulb(at, 0.12);
        let light = SpotLight {
            color: LAMP,
            intensity: 60_000.0,
            range: 18.0,
            outer_angle: 1.1,
            inner_angle: 0.7,
            shadow_maps_enabled: true,
            ..default()
        };
        let place = Transform::from_translation(at - Vec3::Y * 0.15).looking_to(towards, Vec3::X);
        self.commands.spawn((light, place));
    }

    /// A candle: a small light whose shadows fill a room.
    pub(crate) fn candle(&mut self, at: Vec3) {
        let wax = self.surfaces.canvas.clone();
        self.drum(0.03, 0.2, at + Vec3::Y * 0.1, &wax);
        self.bulb(at + Vec3::Y * 0.25, 0.025);
        let light = PointLight {
            color: Color::srgb(1.0, 0.55, 0.22),
            intensity: 7000.0,
            range: 14.0,
            shadow_maps_enabled: true,
            ..default()
        };
        self.commands.spawn((light, Transform::from_translation(at + Vec3::Y * 0.3)));
    }

    /// A lit window: a pane on a wall, `out`wards from it.
    pub(crate) fn window(&mut self, centre: Vec3, out: Vec3, is_lit: bool) {
        let frame = self.surfaces.dark_wood.clone();
        let across = out.cross(Vec3::Y).abs();
        let size = |width: f32, height: f32, depth: f32| {
            across * width + Vec3::Y * height + out.abs() * depth
        };
        self.block(size(1.15, 1.35, 0.1), centre, &frame);
        let pane = if is_lit { self.surfaces.window.clone() } else { self.surfaces.iron.clone() };
        for side in [-0.25, 0.25] {
            self.block(size(0.42, 1.1, 0.04), centre + across * side + out * 0.05, &pane);
        }
    }
}
