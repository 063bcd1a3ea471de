//! Loading frontier maps as Bevy assets.

use bevy::app::{App, Plugin};
use bevy::asset::io::Reader;
use bevy::asset::{AssetApp, AssetLoader, LoadContext};
use bevy::reflect::TypePath;

use super::{FrontierMap, FrontierMapError};

/// Asset loader of [`FrontierMap`]s from `*.pareto.ron` files: RON text in UTF-8, validated. Fails
/// with [`FrontierMapLoadError`].
#[derive(Default, TypePath)]
pub struct FrontierMapLoader;

/// Why a frontier map did not load. The asset server adds the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrontierMapLoadError {
    /// The file cannot be read.
    #[error("frontier map cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The file is not UTF-8 text.
    #[error("frontier map is not UTF-8 text from byte {} on: run `frugal precompute` again", .0.valid_up_to())]
    NotText(#[from] std::str::Utf8Error),
    /// The text is not a valid map of this version.
    #[error(transparent)]
    Map(#[from] FrontierMapError),
}

impl AssetLoader for FrontierMapLoader {
    type Asset = FrontierMap;
    type Settings = ();
    type Error = FrontierMapLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _: &(),
        _: &mut LoadContext<'_>,
    ) -> Result<FrontierMap, FrontierMapLoadError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        Ok(FrontierMap::from_ron(std::str::from_utf8(&bytes)?)?)
    }

    fn extensions(&self) -> &[&str] {
        &["pareto.ron"]
    }
}

/// Registers [`FrontierMap`] as an asset that the asset server loads and reloads. Needs Bevy's
/// `AssetPlugin`, added before.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrontierMapPlugin;

impl Plugin for FrontierMapPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<FrontierMap>().init_asset_loader::<FrontierMapLoader>();
    }
}
