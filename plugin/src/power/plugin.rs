//! The sampler in a Bevy app: starts it for the rendering device, and publishes its figures every
//! frame.

use std::sync::Arc;
use std::time::Duration;

use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
// The standard one panics in a browser.
use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;

use crate::power::meter::SaidFaults;
use crate::power::{
    Adapter, MeterInfo, MeterState, OpenMeterError, PowerMeter, PowerSampler, SamplerSettings,
    detect, open,
};
use crate::units::Watts;

/// Opens a meter, on the sampling thread. An error makes [`MeteredPower::state`] `Unavailable` with
/// its message, and it is called again after 5 s, 10 s, 20 s, and then every 40 s; never again after
/// it has opened one.
pub type MeterFactory = Arc<dyn Fn() -> Result<Box<dyn PowerMeter>, OpenMeterError> + Send + Sync>;

/// Selects the meter that an app reads.
#[derive(Clone, Default)]
#[non_exhaustive]
pub enum MeterChoice {
    /// The first meter that covers the rendering device, by [`detect`]; meters of other devices are
    /// never used.
    #[default]
    Automatic,
    /// A meter by name, whatever it covers, by [`open`].
    Named(String),
    /// The app's own meter: a simulated device, or a meter that this crate lacks.
    Custom(MeterFactory),
    /// No meter: no thread is started, and [`MeteredPower::state`] is `Unavailable`.
    Off,
}

/// Meters the app's power in the background: [`MeteredPower`] and [`PowerPlugin::POWER`].
///
/// Without a meter the app continues, with one warning and the reason in [`MeteredPower::state`].
#[derive(Clone, Default)]
pub struct PowerPlugin {
    /// The meter to read. Default: automatic.
    pub meter: MeterChoice,
    /// Sampling interval and smoothing.
    pub sampler: SamplerSettings,
}

impl PowerPlugin {
    /// Diagnostic path of the metered power, in watts: one measurement per sampling interval, none
    /// while the meter is lost.
    pub const POWER: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/power/board");
}

/// The app's metered power. Written in [`PowerSystems::Publish`], read-only for the app.
#[derive(Resource, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource)]
#[non_exhaustive]
pub struct MeteredPower {
    /// Mean power over the last sampling interval, in watts; finite, at least 0. `None` while
    /// unknown, which differs from 0 W.
    pub latest: Option<Watts>,
    /// Smoothed power, in watts; finite, at least 0. `None` while unknown.
    pub mean: Option<Watts>,
    /// Length of the interval that `latest` is the mean of; above 0. `None` while unknown.
    pub interval: Option<Duration>,
    /// When the reading that ends this interval was taken, on the monotonic clock. `None` while
    /// unknown. See [`age`](Self::age).
    pub read_at: Option<Instant>,
    /// Number of intervals so far: another number is another reading.
    pub sample_count: u64,
    /// The meter and its provenance, once it is open. Show a modelled figure as modelled.
    pub info: Option<MeterInfo>,
    /// Whether the power is known, and if not, why.
    pub state: MeterState,
}

impl MeteredPower {
    /// Time since the reading that `latest` is of; `None` while the power is unknown. It grows
    /// beyond the interval where the meter updates more slowly than it is polled.
    pub fn age(&self) -> Option<Duration> {
        self.read_at.map(|at| at.elapsed())
    }
}

/// When power is published.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PowerSystems {
    /// In [`PreUpdate`]: writes [`MeteredPower`] and the diagnostic, so that all systems in
    /// `Update` read the same figures.
    Publish,
}

/// Settings of [`PowerPlugin`].
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
            .register_diagnostic(Diagnostic::new(Self::POWER).with_suffix(" W"))
            // Needs Startup and not build: the adapter is chosen only after all plugins are built.
            .add_systems(Startup, start_sampler)
            .add_systems(
                PreUpdate,
                publish_power
                    .in_set(PowerSystems::Publish)
                    .run_if(resource_exists::<RunningSampler>),
            );
    }
}

/// From now on the app starts no meter: something else reads it.
#[cfg(feature = "stage")]
pub(crate) fn switch_off(world: &mut World) {
    if let Some(mut settings) = world.get_resource_mut::<PowerSettings>() {
        settings.0.meter = MeterChoice::Off;
    }
}

/// Starts the sampler for the rendering device.
fn start_sampler(
    mut commands: Commands,
    settings: Res<PowerSettings>,
    adapter_info: Option<Res<RenderAdapterInfo>>,
    mut metered: ResMut<MeteredPower>,
) {
    let adapter = adapter_info.map(|info| Adapter::from(&*info.0)).unwrap_or_default();
    let PowerPlugin { meter, sampler } = settings.0.clone();
    let started = match meter {
        MeterChoice::Automatic => PowerSampler::start(move || detect(&adapter), sampler, false),
        MeterChoice::Named(name) => PowerSampler::start(move || open(&name), sampler, false),
        MeterChoice::Custom(factory) => PowerSampler::start(move || factory(), sampler, false),
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

/// Publishes changed figures of the sampler. Warns once of each fault.
fn publish_power(
    sampler: Res<RunningSampler>,
    mut metered: ResMut<MeteredPower>,
    mut diagnostics: Diagnostics,
    mut seen: Local<Option<(u64, bool)>>,
    mut said: Local<SaidFaults>,
    mut started: Local<Option<Instant>>,
) {
    let Some(snapshot) = sampler.0.snapshot_if_changed(&mut seen) else { return };
    if let (Some(latest), true) = (snapshot.latest, snapshot.sample_count > metered.sample_count) {
        diagnostics.add_measurement(&PowerPlugin::POWER, || latest.0);
    }
    if let MeterState::Lost { reason } | MeterState::Unavailable { reason } = &snapshot.state
        && said.is_new(reason, started.get_or_insert_with(Instant::now).elapsed())
    {
        warn!("power is not metered: {reason}");
    }
    if metered.info.is_none()
        && let Some(info) = &snapshot.info
    {
        info!("power meter: {} ({:?}): {}", info.name, info.provenance, info.description);
    }
    metered.set_if_neq(MeteredPower {
        latest: snapshot.latest,
        mean: snapshot.mean,
        interval: snapshot.interval,
        read_at: sampler.0.read_at(&snapshot),
        sample_count: snapshot.sample_count,
        info: snapshot.info,
        state: snapshot.state,
    });
}

#[cfg(test)]
mod tests {
    use std::thread;

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

    /// Runs frames until the power meets the condition. Fails after 20 s.
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
    fn publishes_power_its_provenance_and_a_diagnostic() {
        let mut app =
            app_with(scripted((0..500).map(|index| Ok(Joules(f64::from(index)))).collect()));
        let power = run_until(&mut app, "power", |power| power.latest.is_some());
        assert_eq!(power.state, MeterState::Running);
        let age = power.age().expect("an age");
        assert!(age < Duration::from_secs(20), "{age:?}");
        assert_eq!(power.info.unwrap().name, ScriptedMeter::NAME);
        app.update();
        let diagnostics = app.world().resource::<DiagnosticsStore>();
        let diagnostic = diagnostics.get(&PowerPlugin::POWER).unwrap();
        assert!(diagnostic.value().unwrap() > 0.0);
        assert_eq!(diagnostic.suffix, " W");
    }

    #[test]
    fn continues_without_a_meter() {
        let mut app = app_with(MeterChoice::Named("no such meter".to_owned()));
        let power = run_until(&mut app, "refusal", |power| power.state != MeterState::Starting);
        assert!(matches!(power.state, MeterState::Unavailable { .. }) && power.latest.is_none());
        app.update();
        assert!(
            app.world()
                .resource::<DiagnosticsStore>()
                .get(&PowerPlugin::POWER)
                .unwrap()
                .value()
                .is_none()
        );
    }

    #[test]
    fn a_meter_without_permission_is_lost_with_the_reason() {
        let denied = Err(MeterError::unreadable(ScriptedMeter::NAME, "permission denied"));
        let mut app = app_with(scripted(vec![Ok(Joules(0.0)), Ok(Joules(1.0)), denied]));
        let power =
            run_until(&mut app, "loss", |power| matches!(power.state, MeterState::Lost { .. }));
        assert_eq!((power.latest, power.mean, power.age()), (None, None, None));
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
