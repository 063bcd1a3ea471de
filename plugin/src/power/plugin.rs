//! The sampler in a Bevy app: starts it for the device that renders, and publishes what it knows
//! every frame.

use std::fmt;
use std::sync::Arc;

use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;

use crate::power::{
    Adapter, AdapterKind, MeterInfo, MeterState, OpenMeterError, PowerMeter, PowerSampler,
    SamplerSettings, detect, open,
};
use crate::units::Watts;

/// Diagnostic of the metered power, in watts: one measurement per interval of the sampler, none
/// while the meter is lost.
pub const POWER_DIAGNOSTIC: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/power/board");

/// Makes a meter, on the sampling thread.
pub type MeterFactory = Arc<dyn Fn() -> Result<Box<dyn PowerMeter>, OpenMeterError> + Send + Sync>;

/// Which meter an app reads.
#[derive(Clone, Default)]
pub enum MeterChoice {
    /// The first that covers the device that renders: [`detect`].
    #[default]
    Automatic,
    /// By name, whatever it covers: [`open`].
    Named(String),
    /// The app's own: a simulated device, or a meter that this crate does not know.
    Custom(MeterFactory),
    /// None: no thread is started, and [`MeteredPower`] says so.
    Off,
}

impl fmt::Debug for MeterChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Automatic => f.write_str("Automatic"),
            Self::Named(name) => f.debug_tuple("Named").field(name).finish(),
            Self::Custom(_) => f.write_str("Custom"),
            Self::Off => f.write_str("Off"),
        }
    }
}

/// Meters the app's power in the background: [`MeteredPower`] and [`POWER_DIAGNOSTIC`].
///
/// Without a meter the app runs on, with one warning and the reason in [`MeteredPower::state`].
#[derive(Clone, Debug, Default)]
pub struct PowerPlugin {
    /// Which meter to read.
    pub meter: MeterChoice,
    /// How often to read it, and how much to smooth.
    pub sampler: SamplerSettings,
}

/// The app's power as the meter tells it. Written in [`PowerSystems::Publish`]; read it anywhere.
#[derive(Resource, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource)]
pub struct MeteredPower {
    /// Power over the last interval of the sampler. Finite. `None` where it is not known, which is
    /// not 0 W.
    pub latest: Option<Watts>,
    /// Smoothed power. Finite. `None` where it is not known.
    pub mean: Option<Watts>,
    /// The meter and its provenance, once it is open. A modelled figure is to be shown as one.
    pub info: Option<MeterInfo>,
    /// Whether there is power to be told, and if not, why.
    pub state: MeterState,
}

/// Where power is published.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PowerSystems {
    /// [`PreUpdate`]: writes [`MeteredPower`] and the diagnostic, so that everything in `Update`
    /// sees the same figures.
    Publish,
}

/// What [`PowerPlugin`] was told.
#[derive(Resource)]
struct PowerSettings(PowerPlugin);

/// The running sampler. Dropped with the app, which stops its thread.
#[derive(Resource)]
struct RunningSampler(PowerSampler);

impl Plugin for PowerPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<MeteredPower>()
            .init_resource::<MeteredPower>()
            .insert_resource(PowerSettings(self.clone()))
            .register_diagnostic(Diagnostic::new(POWER_DIAGNOSTIC).with_suffix(" W"))
            // Need Startup and not build: the adapter is chosen only when all plugins are built.
            .add_systems(Startup, start_sampler)
            .add_systems(
                PreUpdate,
                publish_power
                    .in_set(PowerSystems::Publish)
                    .run_if(resource_exists::<RunningSampler>),
            );
    }
}

/// Starts the sampler for the device that renders.
fn start_sampler(
    mut commands: Commands,
    settings: Res<PowerSettings>,
    adapter_info: Option<Res<RenderAdapterInfo>>,
    mut metered: ResMut<MeteredPower>,
) {
    let adapter = adapter_info.map(|info| describe(&info)).unwrap_or_default();
    let PowerPlugin { meter, sampler } = settings.0.clone();
    let started = match meter {
        MeterChoice::Automatic => PowerSampler::start_with(move || detect(&adapter), sampler),
        MeterChoice::Named(name) => PowerSampler::start_with(move || open(&name), sampler),
        MeterChoice::Custom(factory) => PowerSampler::start_with(move || factory(), sampler),
        MeterChoice::Off => {
            metered.state =
                MeterState::Unavailable { reason: "metering is switched off".to_owned() };
            return;
        }
    };
    match started {
        Ok(sampler) => commands.insert_resource(RunningSampler(sampler)),
        Err(error) => {
            warn!("power is not metered: {error}");
            metered.state = MeterState::Unavailable { reason: error.to_string() };
        }
    }
}

/// The renderer's adapter in this crate's words.
fn describe(info: &RenderAdapterInfo) -> Adapter {
    // Bevy hands out the adapter's description but not the type of this field, and depending on the
    // graphics library for one name is not worth it.
    let kind = match format!("{:?}", info.device_type).as_str() {
        "Cpu" => AdapterKind::Software,
        "IntegratedGpu" | "DiscreteGpu" | "VirtualGpu" => AdapterKind::Hardware,
        _ => AdapterKind::Unknown,
    };
    Adapter { kind, name: info.name.clone(), pci_bus_id: info.device_pci_bus_id.clone() }
}

/// Publishes the sampler's news. Warns once per reason that there is no power to be told.
fn publish_power(
    sampler: Res<RunningSampler>,
    mut metered: ResMut<MeteredPower>,
    mut diagnostics: Diagnostics,
    mut seen: Local<Option<(u64, bool)>>,
    mut sample_count: Local<u64>,
    mut warned: Local<Option<String>>,
) {
    let Some(snapshot) = sampler.0.news(&mut seen) else { return };
    if let (Some(latest), true) = (snapshot.latest, snapshot.sample_count > *sample_count) {
        diagnostics.add_measurement(&POWER_DIAGNOSTIC, || latest.0);
    }
    *sample_count = snapshot.sample_count;
    if let MeterState::Lost { reason } | MeterState::Unavailable { reason } = &snapshot.state
        && warned.as_ref() != Some(reason)
    {
        warn!("power is not metered: {reason}");
        *warned = Some(reason.clone());
    }
    if metered.info.is_none()
        && let Some(info) = &snapshot.info
    {
        info!("power meter: {} ({:?}): {}", info.name, info.provenance, info.description);
    }
    *metered = MeteredPower {
        latest: snapshot.latest,
        mean: snapshot.mean,
        info: snapshot.info,
        state: snapshot.state,
    };
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::{Duration, Instant};

    use bevy::diagnostic::DiagnosticsStore;

    use super::*;
    use crate::power::{MeterError, ScriptedMeter};
    use crate::units::Joules;

    fn app_with(meter: MeterChoice) -> App {
        let mut app = App::new();
        let sampler =
            SamplerSettings { interval: Duration::from_millis(50), ..SamplerSettings::default() };
        app.add_plugins((MinimalPlugins, PowerPlugin { meter, sampler }));
        app
    }

    /// Runs frames until the power is as wanted. Fails after 20 s.
    fn run_until(app: &mut App, what: &str, is_so: impl Fn(&MeteredPower) -> bool) -> MeteredPower {
        let start = Instant::now();
        loop {
            app.update();
            let power = app.world().resource::<MeteredPower>();
            if is_so(power) {
                return power.clone();
            }
            assert!(start.elapsed() < Duration::from_secs(20), "no {what}: {power:?}");
            thread::sleep(Duration::from_millis(2));
        }
    }

    fn scripted(readings: Vec<Result<Joules, MeterError>>) -> MeterChoice {
        MeterChoice::Custom(Arc::new(move || Ok(Box::new(ScriptedMeter::new(readings.clone())))))
    }

    #[test]
    fn publishes_power_its_origin_and_a_diagnostic() {
        let mut app =
            app_with(scripted((0..500).map(|index| Ok(Joules(f64::from(index)))).collect()));
        let power = run_until(&mut app, "power", |power| power.latest.is_some());
        assert_eq!(power.state, MeterState::Running);
        assert_eq!(power.info.unwrap().name, ScriptedMeter::NAME);
        app.update();
        let diagnostics = app.world().resource::<DiagnosticsStore>();
        let diagnostic = diagnostics.get(&POWER_DIAGNOSTIC).unwrap();
        assert!(diagnostic.value().unwrap() > 0.0);
        assert_eq!(diagnostic.suffix, " W");
    }

    #[test]
    fn runs_on_without_a_meter() {
        let mut app = app_with(MeterChoice::Named("no such meter".to_owned()));
        let power = run_until(&mut app, "refusal", |power| power.state != MeterState::Starting);
        assert!(matches!(power.state, MeterState::Unavailable { .. }) && power.latest.is_none());
        app.update();
        assert!(
            app.world()
                .resource::<DiagnosticsStore>()
                .get(&POWER_DIAGNOSTIC)
                .unwrap()
                .value()
                .is_none()
        );
    }

    #[test]
    fn a_meter_without_rights_is_lost_and_says_so() {
        let denied = Err(MeterError::unreadable(ScriptedMeter::NAME, "permission denied"));
        let mut app = app_with(scripted(vec![Ok(Joules(0.0)), Ok(Joules(1.0)), denied]));
        let power =
            run_until(&mut app, "loss", |power| matches!(power.state, MeterState::Lost { .. }));
        assert_eq!((power.latest, power.mean), (None, None));
    }

    #[test]
    fn switched_off_it_starts_nothing() {
        let mut app = app_with(MeterChoice::Off);
        app.update();
        assert!(matches!(
            app.world().resource::<MeteredPower>().state,
            MeterState::Unavailable { .. }
        ));
        assert!(!app.world().contains_resource::<RunningSampler>());
    }

    #[test]
    fn automatic_without_a_renderer_does_not_panic() {
        let mut app = app_with(MeterChoice::Automatic);
        let power = run_until(&mut app, "answer", |power| power.state != MeterState::Starting);
        assert_ne!(power.latest, Some(Watts(0.0)));
    }
}
