// Occlusion between two points: rays through a two-level bounding volume hierarchy.
//
// Instances lie in a binary tree (`trace/bvh.rs`) in world space, without a stack: nodes in depth-first
// order, each with a link to the node after its subtree. A mesh's triangles lie in a wide tree
// (`trace/wide.rs`) in the mesh's own space, with a short stack in workgroup memory; the ray's parameter
// is the same in both.
//
// An entry point that traces calls `begin_trace` first.
#define_import_path bevy_frugal_gi::gi::trace::trace

struct Node {
    min: vec3<f32>,
    /// Index of the next node when the box is missed.
    skip: u32,
    max: vec3<f32>,
    /// 0 for an inner node, else first primitive × 8 + number of primitives.
    leaf: u32,
}

/// Up to four boxes on a grid of the node's own, with what they hold.
struct WideNode {
    /// Where the grid begins.
    origin: vec3<f32>,
    /// From the lowest byte: exponents of the grid's steps along x, y, z.
    grid: u32,
    /// A byte for each child, along x, y, z.
    lower: vec3<u32>,
    /// The first inner child; the others follow.
    first_child: u32,
    upper: vec3<u32>,
    /// The first triangle of all leaves.
    first_triangle: u32,
    /// 16 bits for each child: from the lowest, which of the node's triangles it holds (8), and which of the
    /// inner children it is (4).
    held: vec2<u32>,
    padding: vec2<u32>,
}

/// An instance of a mesh.
struct Instance {
    /// Rows of the matrix from the world to the mesh.
    local_from_world: array<vec4<f32>, 3>,
    /// The mesh's first node, or NOTHING.
    root: u32,
    padding_1: u32,
    padding_2: u32,
    padding_3: u32,
}

/// The root of an instance that is gone.
const NOTHING: u32 = 0xffffffffu;

/// A corner and two edges, and an opacity micromap of 64 bits (see `trace/mesh.rs`).
struct Triangle {
    corner: vec3<f32>,
    padding: u32,
    edge_1: vec3<f32>,
    map_low: u32,
    edge_2: vec3<f32>,
    map_high: u32,
}

@group(1) @binding(0) var<storage, read> instance_nodes: array<Node>;
@group(1) @binding(1) var<storage, read> instances: array<Instance>;
@group(1) @binding(2) var<storage, read> mesh_nodes: array<WideNode>;
@group(1) @binding(3) var<storage, read> triangles: array<Triangle>;

/// Most levels of a mesh's tree, of which each leaves at most one entry behind.
const STACK: u32 = 16u;
/// Most threads of a workgroup that traces.
const THREADS: u32 = 64u;

/// STACK × THREADS entries.
var<workgroup> stack: array<u32, 1024>;
var<private> thread: u32;

/// Gives a thread its part of the stack. `index`: of the thread in its workgroup, below THREADS.
fn begin_trace(index: u32) {
    thread = index;
}

/// Reciprocal direction without division by zero, nor NaN from 0 · ∞ in a box test.
fn reciprocal(direction: vec3<f32>) -> vec3<f32> {
    let least = vec3(1e-25);
    return 1.0 / select(max(direction, least), min(direction, -least), direction < vec3(0.0));
}

fn meets_box(node: Node, origin: vec3<f32>, inverse: vec3<f32>) -> bool {
    let a = (node.min - origin) * inverse;
    let b = (node.max - origin) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    let near = max(max(low.x, low.y), max(low.z, 0.0));
    let far = min(min(high.x, high.y), min(high.z, 1.0));
    // Slightly widened, so that rounding opens no seam between boxes.
    return near <= far * 1.0000004;
}

#ifdef SOLID
fn is_opaque(triangle: Triangle, second: f32, third: f32) -> bool {
    return true;
}
#else
/// Whether a triangle is opaque at the barycentric weights of its second and third corner.
fn is_opaque(triangle: Triangle, second: f32, third: f32) -> bool {
    let across = second * 8.0;
    let along = third * 8.0;
    let row = u32(across);
    // Row r begins at bit r · (16 − r), and each of its columns has two micro-triangles, told apart
    // by the sum of both fractions: ⌊across + along⌋ = row + column + (0 or 1). At the farthest
    // corner and by rounding on the longest side this may be a neighbour.
    let micro_triangle = row * (15u - row) + u32(along) + u32(across + along);
    return (select(triangle.map_low, triangle.map_high, micro_triangle >= 32u) >> (micro_triangle & 31u) & 1u) == 1u;
}
#endif

#ifdef FACING
/// Of triangles, 1: their fronts count; -1: their backs; 0: both.
var<private> facing: f32;
#endif

/// Möller and Trumbore 1997, from either side.
fn meets_triangle(triangle: Triangle, origin: vec3<f32>, direction: vec3<f32>) -> bool {
    let p = cross(direction, triangle.edge_2);
    let determinant = dot(triangle.edge_1, p);
#ifdef FACING
    if determinant * facing < 0.0 {
        return false;
    }
#endif
    let inverse = 1.0 / determinant;
    let offset = origin - triangle.corner;
    let u = dot(offset, p) * inverse;
    let q = cross(offset, triangle.edge_1);
    let v = dot(direction, q) * inverse;
    let t = dot(triangle.edge_2, q) * inverse;
    // For a ray in the triangle's plane these are infinite or NaN: no hit.
    return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < 1.0 && is_opaque(triangle, u, v);
}

/// The bytes of a word, from the lowest.
fn bytes_of(word: u32) -> vec4<f32> {
    return vec4<f32>((vec4(word) >> vec4(0u, 8u, 16u, 24u)) & vec4(255u));
}

/// Where along the ray planes of a node's grid are, one for each child.
fn planes(steps: u32, along: f32, start: f32) -> vec4<f32> {
    return bytes_of(steps) * along + start;
}

fn meets_mesh(instance: Instance, world_origin: vec3<f32>, world_direction: vec3<f32>) -> bool {
    if instance.root == NOTHING {
        return false;
    }
    let rows = instance.local_from_world;
    let at = vec4(world_origin, 1.0);
    let along = vec4(world_direction, 0.0);
    let origin = vec3(dot(rows[0], at), dot(rows[1], at), dot(rows[2], at));
    let direction = vec3(dot(rows[0], along), dot(rows[1], along), dot(rows[2], along));
    let inverse = reciprocal(direction);
    let is_negative = inverse < vec3(0.0);
    // Nodes side by side that are still to visit: the first one's index × 16, and a bit for each.
    var nodes = instance.root * 16u + 1u;
    var depth = 0u;
    // Triangles still to test, a bit for each: in the lower half of the node that came last, in the upper
    // half of the one before.
    var held = 0u;
    var first_triangles = vec2(0u);
    loop {
        // Boxes, until two nodes' triangles wait or no box is left: so a workgroup tests most of them
        // together, and its threads wait less for one another.
        while held < 65536u {
            if (nodes & 15u) == 0u {
                if depth == 0u {
                    break;
                }
                depth--;
                nodes = stack[depth * THREADS + thread];
            }
            let node = mesh_nodes[(nodes >> 4u) + firstTrailingBit(nodes)];
            nodes &= nodes - 1u;
            let step = bitcast<vec3<f32>>(((vec3(node.grid) >> vec3(0u, 8u, 16u)) & vec3(255u)) << vec3(23u)) * inverse;
            let start = (node.origin - origin) * inverse;
            let near_side = select(node.lower, node.upper, is_negative);
            let far_side = select(node.upper, node.lower, is_negative);
            let near = max(max(planes(near_side.x, step.x, start.x), planes(near_side.y, step.y, start.y)), max(planes(near_side.z, step.z, start.z), vec4(0.0)));
            let far = min(min(planes(far_side.x, step.x, start.x), planes(far_side.y, step.y, start.y)), min(planes(far_side.z, step.z, start.z), vec4(1.0)));
            // Slightly widened, so that rounding opens no seam between boxes.
            let met = select(vec4(0u), vec4(node.held.xx, node.held.yy) >> vec4(0u, 16u, 0u, 16u), near <= far * 1.0000004);
            let all = met.x | met.y | met.z | met.w;
            let own = all & 255u;
            let inner = (all >> 8u) & 15u;
            if own != 0u {
                held = own | (held << 16u);
                first_triangles = vec2(node.first_triangle, first_triangles.x);
            }
            if inner != 0u {
                if (nodes & 15u) != 0u {
                    stack[depth * THREADS + thread] = nodes;
                    depth++;
                }
                nodes = node.first_child * 16u + inner;
            }
        }
        if held == 0u {
            return false;
        }
        while held != 0u {
            let bit = firstTrailingBit(held);
            let triangle = bit + select(first_triangles.x, first_triangles.y - 16u, bit >= 16u);
            if meets_triangle(triangles[triangle], origin, direction) {
                return true;
            }
            held &= held - 1u;
        }
    }
    return false;
}

/// Whether anything intersects the open segment between two points in the world.
fn is_occluded(origin: vec3<f32>, end: vec3<f32>) -> bool {
    let direction = end - origin;
    let inverse = reciprocal(direction);
    // The buffer may be larger than the tree.
    let count = instance_nodes[0].skip;
    var index = 0u;
    while index < count {
        let node = instance_nodes[index];
        var next = node.skip;
        if meets_box(node, origin, inverse) {
            next = index + 1u;
            let first = node.leaf >> 3u;
            for (var i = 0u; i < (node.leaf & 7u); i++) {
                if meets_mesh(instances[first + i], origin, direction) {
                    return true;
                }
            }
        }
        index = next;
    }
    return false;
}

#ifdef FACING
/// Whether the segment between two points meets backs of triangles, and no front: it begins in a solid
/// and ends outside.
fn leaves_solid(origin: vec3<f32>, end: vec3<f32>) -> bool {
    facing = -1.0;
    let meets_back = is_occluded(origin, end);
    facing = 1.0;
    let leaves = meets_back && !is_occluded(origin, end);
    facing = 0.0;
    return leaves;
}
#endif

/// Whether nothing intersects the ray in a direction (unit length), at any distance.
fn is_open(origin: vec3<f32>, direction: vec3<f32>) -> bool {
    // Beyond the scene: the distance to its centre plus its diagonal.
    let all = instance_nodes[0];
    let reach = distance(origin, 0.5 * (all.min + all.max)) + distance(all.min, all.max);
    return !is_occluded(origin, origin + direction * reach);
}

/// Largest distance of rasterised depth from its surface, as a share of a pixel's width: Vulkan
/// allows vertices to be snapped to sixteenths of a pixel (PowerVR and SwiftShader do that, others
/// snap to 256ths), which shifts a slope by up to √2 ÷ 32 of a pixel's width along its normal.
const SNAPPED: f32 = 0.045;

/// Offset of a ray's ends from a surface, metres: larger than the error of positions from a depth
/// buffer. `width`: of the pixel or texel of the position, metres.
///
/// Higher values lose contact shadows and leak light through thin walls; lower ones cause
/// self-shadowing.
fn surface_offset(position: vec3<f32>, apparent_distance: f32, width: f32) -> f32 {
    let size = max(max(abs(position.x), abs(position.y)), abs(position.z));
    return 5e-4 + 2e-4 * apparent_distance + 4e-7 * size + SNAPPED * width;
}
