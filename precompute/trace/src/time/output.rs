//! Frames as files.

use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec,
    WritableImage,
};

use super::film::Frames;
use crate::color::srgb_from_linear;
use crate::metrics::Picture;

/// Why frames could not be encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// As OpenEXR.
    #[error("cannot encode the layers: {0}")]
    Exr(#[from] exr::error::Error),
    /// As an animation.
    #[error("cannot encode the animation: {0}")]
    Png(#[from] png::EncodingError),
}

impl Frames {
    /// An OpenEXR file with one layer of three float channels for each frame, nits per second;
    /// layers are named by number and middle in picoseconds: `0003 1234.5ps`.
    ///
    /// # Errors
    /// When the encoder refuses the frames, as for empty images.
    pub fn to_exr(&self) -> Result<Vec<u8>, OutputError> {
        let size = (self.width as usize, self.height as usize);
        let layer = |frame: u32| {
            let values = self.frame(frame).unwrap_or_default();
            let channel = |name: &str, i: usize| {
                let samples = values.iter().map(|value| value[i]).collect();
                AnyChannel::new(name, FlatSamples::F32(samples))
            };
            let channels = [channel("R", 0), channel("G", 1), channel("B", 2)];
            let channels = AnyChannels::sort(SmallVec::from_iter(channels));
            let name = format!("{frame:04} {:.1}ps", self.window.middle(frame) * 1e12);
            let name = LayerAttributes::named(name.as_str());
            Layer::new(size, name, Encoding::SMALL_LOSSLESS, channels)
        };
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layers(
            exr::prelude::ImageAttributes::new(exr::prelude::IntegerBounds::from_dimensions(size)),
            (0..self.window.frames).map(layer).collect::<Vec<_>>(),
        )
        .write()
        .to_buffered(&mut bytes)?;
        Ok(bytes.into_inner())
    }

    /// One picture for each frame. All have one exposure: `white`, nits per second, is white; so is
    /// all that is brighter.
    pub fn to_pictures(&self, white: f32) -> Vec<Picture> {
        let display =
            |value: f32| (srgb_from_linear((value / white).clamp(0.0, 1.0)) * 255.0) as u8;
        (0..self.window.frames)
            .filter_map(|frame| self.frame(frame))
            .map(|values| Picture {
                width: self.width,
                height: self.height,
                rgb: values.into_iter().map(|rgb| rgb.map(display)).collect(),
            })
            .collect()
    }

    /// An animated PNG of [`to_pictures`](Self::to_pictures), which repeats; `rate` frames a second.
    ///
    /// # Errors
    /// When the encoder refuses the frames, as for empty images.
    pub fn to_animation(&self, white: f32, rate: u16) -> Result<Vec<u8>, OutputError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_animated(self.window.frames, 0)?;
        encoder.set_frame_delay(1, rate.max(1))?;
        let mut writer = encoder.write_header()?;
        for picture in self.to_pictures(white) {
            writer.write_image_data(picture.rgb.as_flattened())?;
        }
        writer.finish()?;
        Ok(bytes)
    }
}
