//! The bytes of a glTF file's buffers, and bounds-checked typed reads.

use std::path::{Path, PathBuf};

use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, Gltf, buffer};
use thiserror::Error;

/// Why a glTF file cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub(crate) enum GltfError {
    /// A file cannot be read.
    #[error("cannot read {file}: {source}", file = file.display())]
    Unreadable {
        /// The glTF file itself, or one that it names.
        file: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is shorter than its header says: a copy or a download was cut short.
    #[error(
        "it is cut short: its header says {expected} bytes and it has {found}; copy or download it again"
    )]
    Truncated {
        /// Bytes by the header.
        expected: u64,
        /// Bytes in the file.
        found: u64,
    },
    /// The file is not valid glTF 2.0.
    #[error("it is not a valid glTF 2.0 file: {0}")]
    Syntax(#[from] gltf::Error),
    /// The file is inconsistent.
    #[error("it is broken: {0}")]
    Broken(String),
    /// The file uses an unsupported feature.
    #[error("it uses an unsupported feature: {0}")]
    Unsupported(String),
}

/// All buffers of a file, in its order.
pub(super) struct Buffers(Vec<Vec<u8>>);

impl Buffers {
    /// Reads every buffer: the GLB's own, those written into the JSON as base64, and those beside
    /// `path`.
    pub(super) fn read(file: &Gltf, path: &Path) -> Result<Self, GltfError> {
        let mut buffers = Vec::new();
        for buffer in file.buffers() {
            let data = match buffer.source() {
                buffer::Source::Bin => file
                    .blob
                    .clone()
                    .ok_or(GltfError::Broken("it names a missing binary chunk".into()))?,
                buffer::Source::Uri(uri) => read_uri(uri, path)?,
            };
            if data.len() < buffer.length() {
                let (index, wanted) = (buffer.index(), buffer.length());
                return Err(GltfError::Broken(format!(
                    "buffer {index} should hold {wanted} bytes and holds {}",
                    data.len()
                )));
            }
            buffers.push(data);
        }
        Ok(Self(buffers))
    }

    /// Every buffer's bytes.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.0.iter().map(Vec::as_slice)
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, view: &buffer::View) -> Result<&[u8], GltfError> {
        let bytes = self.0.get(view.buffer().index());
        let end = view.offset().checked_add(view.length());
        bytes.zip(end).and_then(|(bytes, end)| bytes.get(view.offset()..end)).ok_or_else(|| {
            GltfError::Broken(format!(
                "buffer view {} reaches beyond buffer {}",
                view.index(),
                view.buffer().index()
            ))
        })
    }

    /// Checks that all elements of an accessor are in its buffer view; returns the view's bytes,
    /// the stride and the first element's offset.
    fn elements(&self, accessor: &Accessor) -> Result<(&[u8], usize, usize), GltfError> {
        let broken =
            |what: &str| GltfError::Broken(format!("accessor {} {what}", accessor.index()));
        if accessor.sparse().is_some() {
            return Err(GltfError::Unsupported(format!(
                "accessor {} is sparse; write it in full",
                accessor.index()
            )));
        }
        let view = accessor.view().ok_or_else(|| broken("has no buffer view"))?;
        let data = self.view(&view)?;
        let stride = view.stride().unwrap_or(accessor.size());
        let end = accessor
            .count()
            .checked_sub(1)
            .and_then(|last| last.checked_mul(stride))
            .and_then(|last| last.checked_add(accessor.offset())?.checked_add(accessor.size()));
        if stride < accessor.size() || end.is_none_or(|end| end > data.len()) {
            return Err(broken(&format!("reaches beyond buffer view {}", view.index())));
        }
        Ok((data, stride, accessor.offset()))
    }

    /// Vectors of `COUNT` numbers; normalised integers become numbers in [0, 1] or [−1, 1]. Wider
    /// elements are truncated, and missing components are 1, as for a colour's alpha.
    pub(super) fn vectors<const COUNT: usize>(
        &self,
        accessor: &Accessor,
        allowed: &[Dimensions],
    ) -> Result<Vec<[f32; COUNT]>, GltfError> {
        let kind = accessor.data_type();
        if !allowed.contains(&accessor.dimensions())
            || (kind != DataType::F32 && !accessor.normalized())
        {
            let (index, dimensions) = (accessor.index(), accessor.dimensions());
            return Err(GltfError::Unsupported(format!(
                "accessor {index} holds {dimensions:?} of {kind:?}, which is not used here"
            )));
        }
        let (data, stride, offset) = self.elements(accessor)?;
        let width = accessor.dimensions().multiplicity();
        let read = |element: usize, component: usize| {
            if component >= width {
                return 1.0;
            }
            scalar(&data[offset + element * stride + component * kind.size()..], kind)
        };
        Ok((0..accessor.count())
            .map(|element| std::array::from_fn(|component| read(element, component)))
            .collect())
    }

    /// Indices of one, two or four bytes.
    pub(super) fn indices(&self, accessor: &Accessor) -> Result<Vec<u32>, GltfError> {
        let kind = accessor.data_type();
        if accessor.dimensions() != Dimensions::Scalar
            || !matches!(kind, DataType::U8 | DataType::U16 | DataType::U32)
        {
            return Err(GltfError::Broken(format!(
                "accessor {} cannot hold indices",
                accessor.index()
            )));
        }
        let (data, stride, offset) = self.elements(accessor)?;
        let read = |element: usize| {
            let at = &data[offset + element * stride..];
            match kind {
                DataType::U8 => u32::from(at[0]),
                DataType::U16 => u32::from(u16::from_le_bytes([at[0], at[1]])),
                _ => u32::from_le_bytes([at[0], at[1], at[2], at[3]]),
            }
        };
        Ok((0..accessor.count()).map(read).collect())
    }
}

/// The first component of `data`; the caller has checked the length.
fn scalar(data: &[u8], kind: DataType) -> f32 {
    match kind {
        DataType::U8 => f32::from(data[0]) / 255.0,
        DataType::I8 => (f32::from(data[0] as i8) / 127.0).max(-1.0),
        DataType::U16 => f32::from(u16::from_le_bytes([data[0], data[1]])) / 65535.0,
        DataType::I16 => (f32::from(i16::from_le_bytes([data[0], data[1]])) / 32767.0).max(-1.0),
        DataType::U32 => {
            (f64::from(u32::from_le_bytes([data[0], data[1], data[2], data[3]]))
                / f64::from(u32::MAX)) as f32
        }
        DataType::F32 => f32::from_le_bytes([data[0], data[1], data[2], data[3]]),
    }
}

/// The data of a glTF file's URI: base64 in the URI itself, or a file beside `path`.
pub(super) fn read_uri(uri: &str, path: &Path) -> Result<Vec<u8>, GltfError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
        return encoded
            .and_then(base64)
            .ok_or(GltfError::Broken("a data URI is not valid base64".into()));
    }
    if uri.contains("://") {
        return Err(GltfError::Unsupported(format!(
            "\"{uri}\" is not on this machine; put the file beside the scene"
        )));
    }
    let file = path.parent().unwrap_or(Path::new("")).join(uri.replace("%20", " "));
    std::fs::read(&file).map_err(|source| GltfError::Unreadable { file, source })
}

/// Decodes base64 (RFC 4648); `None` where it is malformed.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut bit_count) = (0_u32, 0);
    for character in text.trim_end_matches('=').bytes() {
        let value = match character {
            b'A'..=b'Z' => character - b'A',
            b'a'..=b'z' => character - b'a' + 26,
            b'0'..=b'9' => character - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = (bits << 6 | u32::from(value)) & 0xff_ffff;
        bit_count += 6;
        if bit_count >= 8 {
            bit_count -= 8;
            bytes.push((bits >> bit_count) as u8);
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_decodes_and_refuses() {
        assert_eq!(base64("TWFu").as_deref(), Some(&b"Man"[..]));
        assert_eq!(base64("TWE=").as_deref(), Some(&b"Ma"[..]));
        assert_eq!(base64("TQ==").as_deref(), Some(&b"M"[..]));
        assert_eq!(base64("T!=="), None);
    }
}
