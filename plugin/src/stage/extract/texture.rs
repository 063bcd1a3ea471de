//! Images as a shader reads them.

use bevy::image::{Image, ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::render::render_resource::{TextureDimension, TextureFormat};
use frugal_trace::scene::{Filter, SceneTexture, Texels, Wrap};

/// Why an image cannot be read.
pub(super) type Unreadable = &'static str;

/// Level 0 of a flat image.
pub(super) fn texture(image: &Image) -> Result<SceneTexture, Unreadable> {
    let size = image.texture_descriptor.size;
    if image.texture_descriptor.dimension != TextureDimension::D2 || size.depth_or_array_layers != 1
    {
        return Err("images that are not flat are read as white");
    }
    let sampler = match &image.sampler {
        ImageSampler::Default => &ImageSamplerDescriptor::linear(),
        ImageSampler::Descriptor(sampler) => sampler,
    };
    let wrap = [sampler.address_mode_u, sampler.address_mode_v].map(|mode| match mode {
        ImageAddressMode::Repeat => Wrap::Repeat,
        ImageAddressMode::MirrorRepeat => Wrap::Mirror,
        // A border's colour is rare, and near the edge's.
        ImageAddressMode::ClampToEdge | ImageAddressMode::ClampToBorder => Wrap::Clamp,
    });
    let filter = match sampler.mag_filter {
        ImageFilterMode::Linear => Filter::Linear,
        ImageFilterMode::Nearest => Filter::Nearest,
    };
    let count = size.width as usize * size.height as usize;
    let texels = texels(image, 0, count)?;
    let texture = SceneTexture { width: size.width, height: size.height, texels, wrap, filter };
    if texture.is_complete() { Ok(texture) } else { Err("images without texels are read as white") }
}

/// `count` texels from the `first` byte of an image's data on.
pub(super) fn texels(image: &Image, first: usize, count: usize) -> Result<Texels, Unreadable> {
    use TextureFormat::*;
    let Some(data) = &image.data else {
        return Err("images kept for the GPU alone are read as white");
    };
    let data = data.get(first..).unwrap_or_default();
    Ok(match image.texture_descriptor.format {
        Rgba8UnormSrgb => Texels::Srgb(bytes(data, count)),
        Bgra8UnormSrgb => Texels::Srgb(swapped(bytes(data, count))),
        Rgba8Unorm => Texels::Linear(bytes(data, count)),
        Bgra8Unorm => Texels::Linear(swapped(bytes(data, count))),
        R8Unorm => Texels::Linear(padded::<1, 1, _>(data, count, |[value]| value, 0, 255)),
        Rg8Unorm => Texels::Linear(padded::<1, 2, _>(data, count, |[value]| value, 0, 255)),
        R16Unorm => Texels::Float(padded::<2, 1, _>(data, count, unorm16, 0.0, 1.0)),
        Rg16Unorm => Texels::Float(padded::<2, 2, _>(data, count, unorm16, 0.0, 1.0)),
        Rgba16Unorm => Texels::Float(padded::<2, 4, _>(data, count, unorm16, 0.0, 1.0)),
        R16Float => Texels::Float(padded::<2, 1, _>(data, count, half, 0.0, 1.0)),
        Rg16Float => Texels::Float(padded::<2, 2, _>(data, count, half, 0.0, 1.0)),
        Rgba16Float => Texels::Float(padded::<2, 4, _>(data, count, half, 0.0, 1.0)),
        R32Float => Texels::Float(padded::<4, 1, _>(data, count, f32::from_le_bytes, 0.0, 1.0)),
        Rg32Float => Texels::Float(padded::<4, 2, _>(data, count, f32::from_le_bytes, 0.0, 1.0)),
        Rgba32Float => Texels::Float(padded::<4, 4, _>(data, count, f32::from_le_bytes, 0.0, 1.0)),
        Rgb9e5Ufloat => {
            Texels::Float(data.as_chunks().0.iter().take(count).map(shared_exponent).collect())
        }
        format if format.is_compressed() => {
            return Err("compressed images are read as white");
        }
        _ => return Err("images of unusual formats are read as white"),
    })
}

fn bytes(data: &[u8], count: usize) -> Vec<[u8; 4]> {
    data.as_chunks().0.iter().take(count).copied().collect()
}

fn swapped(texels: Vec<[u8; 4]>) -> Vec<[u8; 4]> {
    texels.into_iter().map(|[blue, green, red, alpha]| [red, green, blue, alpha]).collect()
}

/// Texels of `CHANNELS` channels of `SIZE` bytes each; missing colours are `dark`, missing alpha is
/// `full`, as a shader reads them.
fn padded<const SIZE: usize, const CHANNELS: usize, T: Copy>(
    data: &[u8],
    count: usize,
    value: impl Fn([u8; SIZE]) -> T,
    dark: T,
    full: T,
) -> Vec<[T; 4]> {
    let values = data.as_chunks::<SIZE>().0;
    let texel = |channels: &[[u8; SIZE]; CHANNELS]| {
        let mut texel = [dark, dark, dark, full];
        texel.iter_mut().zip(channels).for_each(|(to, from)| *to = value(*from));
        texel
    };
    values.as_chunks::<CHANNELS>().0.iter().take(count).map(texel).collect()
}

fn unorm16(bytes: [u8; 2]) -> f32 {
    f32::from(u16::from_le_bytes(bytes)) / 65535.0
}

fn half(bytes: [u8; 2]) -> f32 {
    half::f16::from_le_bytes(bytes).to_f32()
}

/// Nine bits per channel and an exponent of five (Vulkan 1.3, "Shared Exponent to RGB").
fn shared_exponent(bytes: &[u8; 4]) -> [f32; 4] {
    let packed = u32::from_le_bytes(*bytes);
    let scale = ((packed >> 27) as f32 - 24.0).exp2();
    let channel = |shift: u32| (packed >> shift & 0x1ff) as f32 * scale;
    [channel(0), channel(9), channel(18), 1.0]
}
