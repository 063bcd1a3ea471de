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
 "meshes":[{"primitives":[{"attributes":{"POSITION":2,"COLOR_0":1},"indices":0,"material":0,"mode":4}]}],
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

fn read(json: &str) -> Result<SceneGeometry, GltfError> {
    parse(&glb(json, &quad_binary()), Path::new("test.glb"))
}

#[test]
fn reads_transforms_colors_and_materials() {
    let geometry = parse(&quad_glb(), Path::new("test.glb")).unwrap();
    assert_eq!(geometry.validate(), Ok(()));
    assert_eq!(geometry.triangle_count(), 2);
    let bounds = geometry.bounds().unwrap();
    assert_eq!((bounds.min, bounds.max), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(3.0, 4.0, 3.0)));
    let mesh = &geometry.meshes[0];
    assert!(
        mesh.normals.iter().all(|normal| normal.distance(Vec3::Z) < 1e-6),
        "normals are computed"
    );
    assert_eq!(mesh.colors[1], [0.0, 1.0, 1.0, 1.0]);
    assert!((mesh.colors[2][0] - 0.2).abs() < 1e-6, "colours are linear");
    let material = &geometry.materials[mesh.material];
    assert_eq!(
        (material.base_color, material.perceptual_roughness, material.metallic),
        ([0.5, 0.25, 1.0, 1.0], 0.75, 0.0)
    );
    assert_eq!(
        (material.alpha, material.double_sided, material.emissive),
        (AlphaMode::Mask(0.25), true, [0.0, 0.0, 1.0])
    );
    assert_eq!(geometry.merge().meshes[0].colors[0], [0.5, 0.25, 1.0, 1.0]);
}

#[test]
fn a_specular_factor_scales_the_reflectance() {
    let reflectance = |factor: &str| {
        let extension = format!(
            r#""extensions":{{"KHR_materials_specular":{{"specularFactor":{factor}}}}},"alphaMode""#
        );
        read(&QUAD.replace("\"alphaMode\"", &extension)).unwrap().materials[0].reflectance
    };
    assert_eq!(read(QUAD).unwrap().materials[0].reflectance, 0.5);
    for (factor, expected) in [("0", 0.0), ("0.7", 0.35), ("9", 0.5), ("\"no\"", 0.5)] {
        assert_eq!(reflectance(factor), expected, "{factor}");
    }
}

#[test]
fn strips_fans_and_mirrors_keep_their_fronts() {
    // In the order 0, 1, 3, 2 the quad is a strip; in 0, 1, 2, 3 it is a fan.
    for (mode, order) in [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let json = QUAD
            .replace("\"mode\":4", &format!("\"mode\":{mode}"))
            .replace("\"count\":6", "\"count\":4");
        let mut binary = quad_binary();
        binary[..4].copy_from_slice(&order);
        let geometry = parse(&glb(&json, &binary), Path::new("test.glb")).unwrap();
        assert_eq!(geometry.triangle_count(), 2);
        assert!(geometry.meshes[0].normals.iter().all(|normal| normal.z > 0.9), "mode {mode}");
    }
    let geometry = read(&QUAD.replace("[2,2,2]", "[-2,2,2]")).unwrap();
    assert!(
        geometry.meshes[0].normals.iter().all(|normal| normal.z > 0.9),
        "a mirrored quad still faces +Z"
    );
    let lines = read(&QUAD.replace("\"mode\":4", "\"mode\":1")).unwrap_err();
    assert!(lines.to_string().contains("no triangles"), "{lines}");
}

#[test]
fn embedded_textures_are_decoded_or_left_out_with_a_warning() {
    let mut picture = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(4, 4, image::Rgba([10, 20, 30, 255]))
        .write_to(&mut picture, image::ImageFormat::Png)
        .unwrap();
    let picture = picture.into_inner();
    let with_texture = |data: &[u8]| {
        let json = QUAD
            .replace("\"baseColorFactor\"", "\"baseColorTexture\":{\"index\":0},\"baseColorFactor\"")
            .replace(
                "\"materials\"",
                "\"textures\":[{\"source\":0}],\"images\":[{\"bufferView\":3,\"mimeType\":\"image/png\"}],\"materials\"",
            )
            .replace("\"byteLength\":48}", &format!("\"byteLength\":48}},{{\"buffer\":0,\"byteOffset\":72,\"byteLength\":{}}}", data.len()))
            .replace("\"byteLength\":72", &format!("\"byteLength\":{}", 72 + data.len()));
        let mut binary = quad_binary();
        binary.extend(data);
        binary.resize(binary.len().next_multiple_of(4), 0);
        parse(&glb(&json, &binary), Path::new("test.glb")).unwrap()
    };
    let geometry = with_texture(&picture);
    assert_eq!(geometry.materials[0].base_color_texture, Some(0));
    assert_eq!((geometry.textures[0].width, geometry.textures[0].mips.len()), (4, 3));
    assert_eq!(geometry.textures[0].mips[0][..4], [10, 20, 30, 255]);
    let geometry = with_texture(b"no image");
    assert_eq!(
        (
            geometry.materials[0].base_color_texture,
            geometry.textures.len(),
            geometry.warnings.len()
        ),
        (None, 0, 1)
    );
}

#[test]
fn files_cut_anywhere_are_refused() {
    let whole = quad_glb();
    for length in 0..whole.len() {
        let error = parse(&whole[..length], Path::new("test.glb")).expect_err("cut short");
        assert!(length < 12 || matches!(error, GltfError::Truncated { .. }), "{length}: {error}");
    }
}

#[test]
fn contradictions_are_refused() {
    for (from, to) in [
        ("\"byteOffset\":24", "\"byteOffset\":25"),
        ("\"byteOffset\":24", "\"byteOffset\":18446744073709551615"),
        ("\"count\":4,\"type\":\"VEC3\"", "\"count\":5,\"type\":\"VEC3\""),
        ("\"count\":4,\"type\":\"VEC3\"", "\"count\":4294967295,\"type\":\"VEC3\""),
        ("\"count\":4,\"type\":\"VEC4\"", "\"count\":3,\"type\":\"VEC4\""),
        ("\"bufferView\":2,", ""),
        ("\"bufferView\":2,", "\"bufferView\":9,"),
        ("\"byteLength\":72", "\"byteLength\":720"),
        ("\"POSITION\":2", "\"POSITION\":0"),
        ("\"POSITION\":2", "\"POSITION\":77"),
        ("\"indices\":0", "\"indices\":2"),
        ("\"material\":0", "\"material\":3"),
        ("{\"mesh\":0,", "{\"mesh\":0,\"children\":[0],"),
        ("\"scene\":0", "\"scene\":4"),
        ("\"scale\":[2,2,2]", "\"scale\":[1e39,2,2]"),
        ("\"mode\":4", "\"mode\":44"),
        ("\"buffers\":[{", "\"buffers\":[{\"uri\":\"https://example.org/a.bin\","),
        ("\"buffers\":[{", "\"buffers\":[{\"uri\":\"missing.bin\","),
        ("\"buffers\":[{", "\"buffers\":[{\"uri\":\"data:;base64,!\","),
    ] {
        assert!(QUAD.contains(from), "{from}");
        assert!(read(&QUAD.replacen(from, to, 1)).is_err(), "{to}");
    }
    let mut binary = quad_binary();
    binary[0] = 200;
    assert!(
        parse(&glb(QUAD, &binary), Path::new("test.glb")).unwrap_err().to_string().contains("200")
    );
    let mut binary = quad_binary();
    binary[24..28].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(parse(&glb(QUAD, &binary), Path::new("test.glb")).is_err());
}

#[test]
fn no_single_wrong_byte_panics() {
    let whole = quad_glb();
    for at in 0..whole.len() {
        for flip in [0x01, 0x10, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            if let Ok(geometry) = parse(&bytes, Path::new("test.glb")) {
                assert_eq!(geometry.validate(), Ok(()));
            }
        }
    }
}
