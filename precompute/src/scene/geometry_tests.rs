//! Files that the tests write, through Bevy's loader.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use frugal_trace::scene::{AlphaMode, Texels, Wrap};
use glam::{Affine2, Vec2, Vec3};

use super::*;

/// A GLB of a JSON and a binary chunk.
fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}

const QUAD: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
 "nodes":[{"children":[1],"translation":[1,2,3]},{"mesh":0,"scale":[2,2,2]}],
 "meshes":[{"name":"quad","primitives":[{"attributes":{"POSITION":2,"COLOR_0":1},"indices":0,"material":0,"mode":4}]}],
 "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,1],"metallicFactor":0,"roughnessFactor":0.75},
  "emissiveFactor":[0,0,1],"alphaMode":"MASK","alphaCutoff":0.25,"doubleSided":true}],
 "accessors":[{"bufferView":0,"componentType":5121,"count":6,"type":"SCALAR"},
  {"bufferView":1,"componentType":5121,"normalized":true,"count":4,"type":"VEC4"},
  {"bufferView":2,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
 "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":6},{"buffer":0,"byteOffset":8,"byteLength":16},
  {"buffer":0,"byteOffset":24,"byteLength":48}],
 "buffers":[{"byteLength":72}]}"#;

fn quad_binary() -> Vec<u8> {
    let mut binary = vec![0, 1, 2, 0, 2, 3, 0, 0];
    binary.extend([255, 255, 255, 255, 0, 255, 255, 255, 51, 255, 255, 255, 255, 255, 255, 0]);
    for value in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
        binary.extend(value.to_le_bytes());
    }
    binary
}

/// Two triangles with byte indices, byte colours and a node chain.
pub(in crate::scene) fn quad_glb() -> Vec<u8> {
    glb(QUAD, &quad_binary())
}

/// Reads a file called `name` of these bytes, beside `others`.
fn read_file(
    name: &str,
    bytes: &[u8],
    others: &[(&str, &[u8])],
) -> Result<(SceneGeometry, Vec<String>), String> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in others.iter().chain([&(name, bytes)]) {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    let mut description = SceneDescription::new(Geometry::Gltf(name.to_owned()));
    description.source = folder.path().join("a.scene.ron");
    let (geometry, Checked { gaps, .. }) = read(&description).map_err(|problem| problem.problem)?;
    assert_eq!(geometry.validate(), Ok(()));
    Ok((geometry, gaps))
}

fn read_json(json: &str) -> Result<(SceneGeometry, Vec<String>), String> {
    read_file("test.glb", &glb(json, &quad_binary()), &[])
}

/// A quad in the unit square that faces +z, with two sets of texture coordinates, and what `rest`
/// adds to the file; `material` is that of its only material.
fn textured(material: &str, texture: &str, rest: &str) -> String {
    let mut buffer: Vec<u8> = Vec::new();
    let corners = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for [x, y] in corners {
        [x, y, 0.0].iter().for_each(|value| buffer.extend(value.to_le_bytes()));
    }
    // The second coordinates are the first, moved by 1.
    for offset in [0.0, 1.0] {
        for [x, y] in corners {
            [x + offset, y].iter().for_each(|value| buffer.extend(value.to_le_bytes()));
        }
    }
    [0_u16, 1, 2, 0, 2, 3].iter().for_each(|index| buffer.extend(index.to_le_bytes()));
    let (length, buffer) = (buffer.len(), STANDARD.encode(buffer));
    let mut picture = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(2, 2, image::Rgba([10, 20, 30, 255]))
        .write_to(&mut picture, image::ImageFormat::Png)
        .expect("a picture");
    let picture = STANDARD.encode(picture.into_inner());
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
 "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1,"TEXCOORD_1":2}},"indices":3,"material":0}}]}}],
 "materials":[{{"name":"paint",{material}}}],"textures":[{{"source":0{texture}}}],
 "images":[{{"uri":"data:image/png;base64,{picture}"}}],
 "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
  {{"bufferView":0,"byteOffset":48,"componentType":5126,"count":4,"type":"VEC2"}},
  {{"bufferView":0,"byteOffset":80,"componentType":5126,"count":4,"type":"VEC2"}},
  {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
 "bufferViews":[{{"buffer":0,"byteLength":112}},{{"buffer":0,"byteOffset":112,"byteLength":12}}],
 "buffers":[{{"byteLength":{length},"uri":"data:application/octet-stream;base64,{buffer}"}}]{rest}}}"#
    )
}

fn read_textured(
    material: &str,
    texture: &str,
    rest: &str,
) -> Result<(SceneGeometry, Vec<String>), String> {
    read_file("test.gltf", textured(material, texture, rest).as_bytes(), &[])
}

#[test]
fn reads_transforms_colors_and_materials() {
    let (geometry, gaps) = read_json(QUAD).unwrap();
    assert!(gaps.is_empty(), "{gaps:?}");
    assert_eq!(geometry.triangle_count(), 2);
    let bounds = geometry.bounds().unwrap();
    assert_eq!((bounds.min, bounds.max), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(3.0, 4.0, 3.0)));
    let mesh = &geometry.meshes[0];
    assert!(mesh.normals.iter().all(|normal| normal.distance(Vec3::Z) < 1e-6), "computed");
    assert!(mesh.colors.contains(&[0.0, 1.0, 1.0, 1.0]), "{:?}", mesh.colors);
    assert!(mesh.colors.iter().any(|color| (color[0] - 0.2).abs() < 1e-6), "colours are linear");
    let material = &geometry.materials[mesh.material];
    assert_eq!(
        (material.base_color, material.perceptual_roughness, material.metallic),
        ([0.5, 0.25, 1.0, 1.0], 0.75, 0.0)
    );
    // Emission counts in nits.
    assert_eq!(
        (material.alpha, material.double_sided, material.emissive),
        (AlphaMode::Mask(0.25), true, [0.0, 0.0, 1.0])
    );
}

#[test]
fn factors_of_extensions_are_read() {
    let extended = |extension: &str| {
        let json =
            QUAD.replace("\"alphaMode\"", &format!("\"extensions\":{{{extension}}},\"alphaMode\""));
        read_json(&json).unwrap().0.materials[0].clone()
    };
    assert_eq!(read_json(QUAD).unwrap().0.materials[0].reflectance, 0.5);
    let specular = extended(r#""KHR_materials_specular":{"specularFactor":0.7}"#);
    assert_eq!(specular.reflectance, 0.35);
    let bright = extended(r#""KHR_materials_emissive_strength":{"emissiveStrength":5000}"#);
    assert_eq!(bright.emissive, [0.0, 0.0, 5000.0]);
}

#[test]
fn strips_and_mirrors_keep_their_fronts_and_others_are_named() {
    let facing = |geometry: &SceneGeometry| {
        geometry.triangles().all(|triangle| {
            let [a, b, c] = triangle.corners;
            (b - a).cross(c - a).z > 0.0
        })
    };
    let mirrored = QUAD.replace("[2,2,2]", "[-2,2,2]").replace(",\"doubleSided\":true", "");
    assert!(facing(&read_json(&mirrored).unwrap().0), "a mirrored quad still faces +Z");
    let strip = QUAD.replace("\"mode\":4", "\"mode\":5").replace("\"count\":6", "\"count\":4");
    let mut binary = quad_binary();
    binary[..4].copy_from_slice(&[0, 1, 3, 2]);
    assert!(facing(&read_file("test.glb", &glb(&strip, &binary), &[]).unwrap().0));
    let lines = read_json(&QUAD.replace("\"mode\":4", "\"mode\":1")).unwrap_err();
    assert!(lines.contains("no triangles"), "{lines}");
    let glass = read_json(&QUAD.replace("\"MASK\",\"alphaCutoff\":0.25", "\"BLEND\"")).unwrap_err();
    assert!(glass.contains("no triangles to trace (blended surfaces are left out"), "{glass}");
    let fan = read_json(&QUAD.replace("\"mode\":4", "\"mode\":6")).unwrap_err();
    assert!(fan.contains("primitive mode"), "{fan}");
}

#[test]
fn textures_are_read_as_the_material_says() {
    let use_of = |rest: &str| format!(r#"{{"index":0{rest}}}"#);
    let moved = r#","extensions":{"KHR_texture_transform":{"offset":[0.25,0],"scale":[2,1]}}"#;
    let material = format!(
        r#""pbrMetallicRoughness":{{"baseColorTexture":{base}}},"emissiveFactor":[1,1,1],"emissiveTexture":{emissive}"#,
        base = use_of(&format!(r#","texCoord":1{moved}"#)),
        emissive = use_of(moved)
    );
    let sampler = r#","samplers":[{"wrapS":33648,"wrapT":33071,"magFilter":9728}]"#;
    let required = r#","extensionsUsed":["KHR_texture_transform"],"extensionsRequired":["KHR_texture_transform"]"#;
    let (geometry, gaps) =
        read_textured(&material, r#","sampler":0"#, &format!("{sampler}{required}")).unwrap();
    assert!(gaps.is_empty(), "{gaps:?}");
    let read = &geometry.materials[0];
    let (base, emissive) = (read.base_color_texture.unwrap(), read.emissive_texture.unwrap());
    assert_eq!((base.second_uvs, emissive.second_uvs), (true, false));
    let transform =
        Affine2::from_scale_angle_translation(Vec2::new(2.0, 1.0), 0.0, Vec2::new(0.25, 0.0));
    assert_eq!((base.transform, emissive.transform), (transform, transform));
    let texture = &geometry.textures[base.texture];
    assert_eq!(texture.wrap, [Wrap::Mirror, Wrap::Clamp]);
    assert_eq!(texture.texels, Texels::Srgb(vec![[10, 20, 30, 255]; 4]));
    assert_eq!(geometry.meshes[0].second_uvs[1], Vec2::new(2.0, 0.0));
    // Bevy has one transform for all textures of a material.
    let (base, emissive) = material.split_once("\"emissiveTexture\"").unwrap();
    let emissive = emissive.replace("\"scale\":[2,1]", "\"scale\":[3,1]");
    let differing = format!("{base}\"emissiveTexture\"{emissive}");
    let (_, gaps) =
        read_textured(&differing, r#","sampler":0"#, &format!("{sampler}{required}")).unwrap();
    assert!(gaps.iter().any(|gap| gap.contains("paint")), "{gaps:?}");
    // One that changes nothing is as good as none.
    let still = r#","extensions":{"KHR_texture_transform":{"scale":[1,1]}}"#;
    let (plain, still) = (use_of(""), use_of(still));
    let same = format!(
        r#""pbrMetallicRoughness":{{"baseColorTexture":{plain}}},"emissiveTexture":{still}"#
    );
    let (_, gaps) = read_textured(&same, "", required).unwrap();
    assert!(gaps.is_empty(), "{gaps:?}");
    let third = material.replace("\"texCoord\":1", "\"texCoord\":2");
    let (_, gaps) = read_textured(&third, "", required).unwrap();
    assert!(gaps.iter().any(|gap| gap.contains("texture coordinates")), "{gaps:?}");
}

#[test]
fn metallic_and_roughness_are_linear() {
    let material = r#""pbrMetallicRoughness":{"metallicRoughnessTexture":{"index":0}}"#;
    let (geometry, _) = read_textured(material, "", "").unwrap();
    let read = geometry.materials[0].metallic_roughness_texture.unwrap();
    assert_eq!(geometry.textures[read.texture].texels, Texels::Linear(vec![[10, 20, 30, 255]; 4]));
    assert_eq!(
        (geometry.materials[0].metallic, geometry.materials[0].perceptual_roughness),
        (1.0, 1.0)
    );
}

#[test]
fn missing_images_are_named_and_the_rest_is_read() {
    let material = r#""pbrMetallicRoughness":{"baseColorTexture":{"index":0}}"#;
    let json = textured(material, "", "");
    let start = json.find("data:image").unwrap();
    let end = start + json[start..].find('"').unwrap();
    let with_image = |uri: &str| format!("{}{uri}{}", &json[..start], &json[end..]);
    let (geometry, gaps) =
        read_file("test.gltf", with_image("no%20such.png").as_bytes(), &[]).unwrap();
    assert_eq!((geometry.triangle_count(), geometry.textures.len()), (2, 0));
    assert!(gaps.iter().any(|gap| gap.contains("no such.png")), "{gaps:?}");
    // All in one line.
    let both = format!(r#"{material},"emissiveTexture":{{"index":1}}"#);
    let json_of_two = with_image("one.png")
        .replace(material, &both)
        .replace(r#"[{"source":0}]"#, r#"[{"source":0},{"source":1}]"#)
        .replace(r#""images":["#, r#""images":[{"uri":"two.png"},"#);
    let (_, gaps) = read_file("test.gltf", json_of_two.as_bytes(), &[]).unwrap();
    assert!(gaps.len() == 1, "{gaps:?}");
    assert!(gaps[0].contains("one.png") && gaps[0].contains("two.png"), "{gaps:?}");
    // It is there, in a format without a loader.
    let others: &[(&str, &[u8])] = &[("wall.tga", b"no")];
    let (_, gaps) = read_file("test.gltf", with_image("wall.tga").as_bytes(), others).unwrap();
    let is_named = |gap: &String| gap.contains("cannot be read") && gap.contains("wall.tga");
    assert!(gaps.iter().any(is_named), "{gaps:?}");
    // Names are percent-encoded.
    let mut picture = std::io::Cursor::new(Vec::new());
    let pixel = image::RgbaImage::from_pixel(1, 1, image::Rgba([1, 2, 3, 4]));
    pixel.write_to(&mut picture, image::ImageFormat::Png).unwrap();
    let picture = picture.into_inner();
    let others: &[(&str, &[u8])] = &[("grün 10%.png", &picture)];
    let (geometry, gaps) =
        read_file("möbel & stück.gltf", with_image("gr%C3%BCn%2010%25.png").as_bytes(), others)
            .unwrap();
    assert_eq!(geometry.textures[0].texels, Texels::Srgb(vec![[1, 2, 3, 4]]), "{gaps:?}");
    // An image in the file itself is part of it.
    let broken = with_image("data:image/png;base64,AAAA");
    assert!(read_file("test.gltf", broken.as_bytes(), &[]).is_err());
}

#[test]
fn sparse_accessors_are_read() {
    // Vertex 2 moves to z = 5 by a sparse value.
    let json = QUAD
        .replace(
            r#""count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]"#,
            r#""count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,5],"sparse":{"count":1,
               "indices":{"bufferView":3,"componentType":5123},"values":{"bufferView":4}}"#,
        )
        .replace(
            r#""byteOffset":24,"byteLength":48}"#,
            r#""byteOffset":24,"byteLength":48},{"buffer":0,"byteOffset":72,"byteLength":2},
               {"buffer":0,"byteOffset":76,"byteLength":12}"#,
        )
        .replace("\"byteLength\":72}", "\"byteLength\":88}");
    let mut binary = quad_binary();
    binary.extend([2, 0, 0, 0]);
    [1.0_f32, 1.0, 5.0].iter().for_each(|value| binary.extend(value.to_le_bytes()));
    let (geometry, _) = read_file("test.glb", &glb(&json, &binary), &[]).unwrap();
    assert_eq!(geometry.bounds().unwrap().max.z, 3.0 + 2.0 * 5.0);
}

#[test]
fn skins_and_morphs_are_in_their_pose() {
    // One joint at x = 10 with scale 0.5, and the mesh's own node far away, which does not count.
    let buffer: Vec<u8> = [0_u8; 16]
        .into_iter()
        .chain([1.0_f32, 0.0, 0.0, 0.0].repeat(4).into_iter().flat_map(f32::to_le_bytes))
        .collect();
    let extra = format!(
        r#"{{"byteLength":{},"uri":"data:application/octet-stream;base64,{}"}}"#,
        buffer.len(),
        STANDARD.encode(&buffer)
    );
    let json = QUAD
        .replace("{\"mesh\":0,\"scale\":[2,2,2]}", "{\"mesh\":0,\"skin\":0},{\"translation\":[10,0,0],\"scale\":[0.5,0.5,0.5]}")
        .replace("\"nodes\":[0]", "\"nodes\":[0,2]")
        .replace("\"COLOR_0\":1", "\"COLOR_0\":1,\"JOINTS_0\":3,\"WEIGHTS_0\":4")
        .replace("\"meshes\"", "\"skins\":[{\"joints\":[2]}],\"meshes\"")
        .replace("\"max\":[1,1,0]}]", "\"max\":[1,1,0]},{\"bufferView\":3,\"componentType\":5121,\"count\":4,\"type\":\"VEC4\"},{\"bufferView\":4,\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"}]")
        .replace("\"byteOffset\":24,\"byteLength\":48}", "\"byteOffset\":24,\"byteLength\":48},{\"buffer\":1,\"byteLength\":16},{\"buffer\":1,\"byteOffset\":16,\"byteLength\":64}")
        .replace("\"buffers\":[{\"byteLength\":72}]", &format!("\"buffers\":[{{\"byteLength\":72}},{extra}]"));
    let (geometry, gaps) = read_json(&json).unwrap();
    let bounds = geometry.bounds().unwrap();
    assert_eq!((bounds.min.x, bounds.max.x, bounds.max.z), (10.0, 10.5, 0.0), "{gaps:?}");
    // A target that is the positions themselves, at half its weight.
    let json = QUAD
        .replace("\"indices\":0,", "\"indices\":0,\"targets\":[{\"POSITION\":2}],")
        .replace("\"COLOR_0\":1", "\"NORMAL\":2")
        .replace("\"name\":\"quad\"", "\"name\":\"quad\",\"weights\":[0.5]");
    assert_eq!(read_json(&json).unwrap().0.bounds().unwrap().max.x, 1.0 + 2.0 * 1.5);
}

#[test]
fn what_is_left_out_is_named() {
    let light =
        r#""extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":1}]}},"#;
    let json = QUAD.replacen("{\"asset\"", &format!("{{{light}\"asset\""), 1).replace(
        "{\"mesh\":0,",
        "{\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}},\"mesh\":0,",
    );
    let (geometry, gaps) = read_json(&json).unwrap();
    assert_eq!(
        (geometry.triangle_count(), &gaps[..]),
        (2, &["1 lights of the file are left out".to_owned()][..])
    );
    let used = QUAD.replacen(
        "{\"asset\"",
        "{\"extensionsUsed\":[\"EXT_mesh_gpu_instancing\"],\"asset\"",
        1,
    );
    assert!(read_json(&used).unwrap().1[0].contains("EXT_mesh_gpu_instancing"));
    let integers = QUAD.replace(
        "\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"",
        "\"componentType\":5123,\"count\":4,\"type\":\"VEC3\"",
    );
    assert!(read_json(&integers).unwrap_err().contains("positions of quad"));
    let unread = QUAD.replace("\"normalized\":true,", "");
    assert!(read_json(&unread).unwrap().1[0].contains("COLOR_0 of quad"));
}

#[test]
fn files_cut_anywhere_are_refused() {
    let whole = quad_glb();
    for length in 0..whole.len() {
        let error = document::check(&whole[..length]).expect_err("cut short");
        assert!(length < 12 || error.contains("cut short"), "{length}: {error}");
    }
}

#[test]
fn a_buffer_that_is_cut_short_is_named() {
    let json = QUAD.replace("{\"byteLength\":72}", "{\"uri\":\"a%20b.bin\",\"byteLength\":72}");
    let binary = quad_binary();
    let read =
        |length: usize| read_file("test.gltf", json.as_bytes(), &[("a b.bin", &binary[..length])]);
    assert_eq!(read(72).unwrap().0.triangle_count(), 2);
    let error = read(71).unwrap_err();
    assert!(error.contains("a b.bin is cut short") && error.contains("71 bytes of 72"), "{error}");
}

#[test]
fn contradictions_are_refused() {
    for (from, to) in [
        ("\"byteOffset\":24", "\"byteOffset\":25000"),
        ("\"byteOffset\":24", "\"byteOffset\":18446744073709551615"),
        ("\"count\":4,\"type\":\"VEC3\"", "\"count\":4294967295,\"type\":\"VEC3\""),
        ("\"bufferView\":2,", ""),
        ("\"bufferView\":2,", "\"bufferView\":9,"),
        ("\"byteLength\":72", "\"byteLength\":720"),
        ("\"POSITION\":2", "\"POSITION\":0"),
        ("\"POSITION\":2", "\"POSITION\":77"),
        ("\"material\":0", "\"material\":3"),
        ("{\"mesh\":0,", "{\"mesh\":0,\"children\":[0],"),
        ("\"scene\":0", "\"scene\":4"),
        ("\"scale\":[2,2,2]", "\"scale\":[1e39,2,2]"),
        ("\"mode\":4", "\"mode\":44"),
        ("\"buffers\":[{", "\"buffers\":[{\"uri\":\"missing.bin\","),
        ("\"buffers\":[{", "\"buffers\":[{\"uri\":\"data:;base64,!\","),
    ] {
        assert!(QUAD.contains(from), "{from}");
        assert!(read_json(&QUAD.replacen(from, to, 1)).is_err(), "{to}");
    }
    let mut binary = quad_binary();
    binary[24..28].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(read_file("test.glb", &glb(QUAD, &binary), &[]).is_err());
}

#[test]
fn no_single_wrong_byte_of_the_header_panics() {
    let whole = quad_glb();
    for at in 0..whole.len() {
        for flip in [0x01, 0x10, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            let _ = document::check(&bytes);
        }
    }
}
