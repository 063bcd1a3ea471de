//! How far the device is from throttling.

use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

/// How far the device is from throttling, as the app's platform says it.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ThermalHeadroom {
    /// 1: cool; 0: throttling. Android's thermal headroom counts the other way round. Values beyond
    /// 0 to 1 count as the nearer end, `None` and NaN as unknown. Default: `None`.
    pub share: Option<f64>,
}

impl ThermalHeadroom {
    /// The valid share; `None` if it is unknown.
    pub(crate) fn valid(&self) -> Option<f64> {
        self.share.filter(|share| !share.is_nan()).map(|share| share.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_share_or_unknown() {
        let of = |share| ThermalHeadroom { share: Some(share) }.valid();
        assert_eq!((of(0.4), of(-3.0), of(f64::INFINITY)), (Some(0.4), Some(0.0), Some(1.0)));
        assert_eq!((of(f64::NAN), ThermalHeadroom::default().valid()), (None, None));
    }
}
