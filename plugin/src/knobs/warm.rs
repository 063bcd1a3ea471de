//! Compiles the pipelines of all knob levels in advance.
//!
//! Bevy skips the draws of a pipeline that is not compiled yet: the first switch to a level would
//! show an incomplete or black image.

use std::sync::Arc;

use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::{KnobLevels, KnobSettings, KnobSpace, KnobSystems};
use crate::schedule::PipelinesBusy;

/// Consecutive frames without pending pipelines after which all count as compiled: the renderer's
/// report lags up to two frames behind the settings, and the output of one pass may require the
/// next one's pipeline.
const IDLE_FRAMES: u32 = 4;
/// Timeout of the compiler, in seconds: an invalid shader must not keep an app behind its loading
/// screen.
const MAX_WAIT_SECONDS: f32 = 120.0;

/// Shows each level of each knob on this camera, one per frame, and waits until all their pipelines
/// are compiled; then restores the camera's settings and removes itself. No later switch of a level
/// shows an incomplete image. Each wait ends after 120 s at the latest, with a warning.
///
/// While present it controls the camera's [`KnobSettings`], and the image changes every frame:
/// cover it with a loading screen, and give the camera its [map](crate::control::PowerController)
/// after this component is removed. A camera without settings is left at the best ones.
///
/// Pipelines depend on the visible materials: let the camera view each kind of material of the app
/// (opaque, alpha-masked, …). An inactive camera waits.
#[derive(Component, Clone, Debug)]
pub struct WarmKnobs {
    space: Arc<KnobSpace>,
    levels: Vec<KnobLevels>,
    phase: Phase,
    before: Option<KnobSettings>,
    idle_frames: u32,
    waiting_since: Option<Instant>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The cheapest settings, until the scene's own pipelines are compiled: earlier, a level would
    /// compile no pipelines.
    Begin,
    /// The level shown in this frame.
    Level(usize),
    /// The camera's own settings, until the last pipeline is compiled.
    End,
}

impl WarmKnobs {
    /// Warms every level of `space`.
    pub fn new(space: impl Into<Arc<KnobSpace>>) -> Self {
        let space = space.into();
        let (levels, phase) = (levels_to_show(&space), Phase::Begin);
        Self { space, levels, phase, before: None, idle_frames: 0, waiting_since: None }
    }

    /// Also shows each of `settings` as a whole: passes of several knobs may share a pipeline. Give
    /// those of a map ([`FrontierMap::settings`](crate::frontier::FrontierMap::settings)), and none
    /// of its switches compiles anything.
    #[must_use]
    pub fn with_settings(mut self, settings: impl IntoIterator<Item = KnobLevels>) -> Self {
        for settings in settings {
            let settings = self.space.from_levels(|knob, _| settings.level(knob));
            if !self.levels.contains(&settings) {
                self.levels.push(settings);
            }
        }
        self
    }

    /// Fraction of the levels shown so far, 0 to 1. Stays at 1 while the last pipelines compile.
    pub fn progress(&self) -> f32 {
        match self.phase {
            Phase::Begin => 0.0,
            Phase::Level(shown) => shown as f32 / self.levels.len() as f32,
            Phase::End => 1.0,
        }
    }

    /// The settings for this frame; `None` when the warm-up is complete.
    fn step(&mut self, busy: bool) -> Option<KnobSettings> {
        let phase = self.phase;
        match phase {
            Phase::Level(shown) => self.show(shown + 1),
            Phase::Begin if self.compilation_ended(busy) => self.show(0),
            Phase::End if self.compilation_ended(busy) => return None,
            Phase::Begin | Phase::End => {}
        }
        let settings = match self.phase {
            Phase::Begin => self.space.lowest(),
            Phase::Level(shown) => self.levels[shown],
            Phase::End if self.before.is_some() => return self.before.clone(),
            Phase::End => self.space.highest(),
        };
        Some(KnobSettings { space: Arc::clone(&self.space), settings })
    }

    fn show(&mut self, level: usize) {
        self.phase = if level < self.levels.len() { Phase::Level(level) } else { Phase::End };
        (self.idle_frames, self.waiting_since) = (0, None);
    }

    /// Whether compilation has ended, or has taken too long.
    fn compilation_ended(&mut self, busy: bool) -> bool {
        self.idle_frames = if busy { 0 } else { self.idle_frames + 1 };
        let too_long = self.waiting_since.get_or_insert_with(Instant::now).elapsed().as_secs_f32()
            > MAX_WAIT_SECONDS;
        if too_long {
            warn!(
                "pipelines are still compiling after {MAX_WAIT_SECONDS} s: the warm-up ends without them, so the first switch of a knob may flicker"
            );
        }
        too_long || self.idle_frames >= IDLE_FRAMES
    }
}

/// Every level of every knob, with the other knobs at their cheapest, which keeps the warm-up
/// short. A knob that depends on another is shown with each level of that one: the two may share a
/// pipeline.
pub(crate) fn levels_to_show(space: &KnobSpace) -> Vec<KnobLevels> {
    let mut shown = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        for base in space.cheapest_with(knob) {
            shown.extend((0..knob.levels.len()).map(|level| base.with_level(index, level)));
        }
    }
    shown
}

pub(super) fn build(app: &mut App) {
    // Before settings are applied, so that every frame shows one step.
    app.add_systems(
        PostUpdate,
        warm_knobs.before(KnobSystems::Apply).run_if(any_with_component::<WarmKnobs>),
    );
}

fn warm_knobs(
    mut commands: Commands,
    busy: Option<Res<PipelinesBusy>>,
    mut cameras: Query<(Entity, &Camera, &mut WarmKnobs, Option<&KnobSettings>)>,
) {
    let busy = busy.is_some_and(|busy| busy.get());
    for (entity, camera, mut warm, settings) in &mut cameras {
        if !camera.is_active {
            continue;
        }
        if warm.phase == Phase::Begin && warm.waiting_since.is_none() {
            warm.before = settings.cloned();
        }
        match warm.step(busy) {
            Some(next) if settings != Some(&next) => {
                // The camera may be despawned by the same flush.
                commands.entity(entity).try_insert(next);
            }
            Some(_) => {}
            None => {
                commands.entity(entity).try_remove::<WarmKnobs>();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knobs::{Knob, KnobDriver, KnobPlugin, Level, RegisterKnob};

    /// Records the levels that it was set to.
    struct RecordingKnob;

    #[derive(Resource, Default)]
    struct RecordedLevels(Vec<f64>);

    impl KnobDriver for RecordingKnob {
        fn knob(&self) -> Knob {
            Knob::new("recorded", [1.0, 2.0, 3.0])
        }

        fn apply(&self, world: &mut World, _: Entity, level: &Level) {
            world.get_resource_or_init::<RecordedLevels>().0.push(level.value);
        }
    }

    fn run(
        before: Option<KnobLevels>,
        busy: impl Fn(usize) -> bool,
    ) -> (Vec<f64>, Option<KnobLevels>, usize) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, KnobPlugin)).register_knob(RecordingKnob);
        let pipelines_busy = PipelinesBusy::new(true);
        app.insert_resource(pipelines_busy.clone());
        let all =
            app.world().resource::<crate::knobs::KnobRegistry>().space().expect("a valid registry");
        let space = Arc::new(all.subset(["recorded"]).expect("the knob above"));
        let camera =
            app.world_mut().spawn((Camera::default(), WarmKnobs::new(Arc::clone(&space)))).id();
        if let Some(settings) = before {
            app.world_mut().entity_mut(camera).insert(KnobSettings { space, settings });
        }
        let mut frames = 0;
        while app.world().get::<WarmKnobs>(camera).is_some() {
            pipelines_busy.set(busy(frames));
            app.update();
            frames += 1;
            assert!(frames < 100, "the warm-up never ends");
        }
        let settings = app.world().get::<KnobSettings>(camera).map(|settings| settings.settings);
        (app.world().resource::<RecordedLevels>().0.clone(), settings, frames)
    }

    #[test]
    fn every_level_is_shown_and_the_settings_are_restored() {
        let middle = KnobLevels::default().with_level(0, 1);
        let (shown, after, _) = run(Some(middle), |_| false);
        assert_eq!(shown, [1.0, 2.0, 3.0, 2.0]);
        assert_eq!(after, Some(middle));
    }

    #[test]
    fn without_settings_the_best_are_left() {
        let (shown, after, _) = run(None, |_| false);
        assert_eq!(shown, [1.0, 2.0, 3.0]);
        assert_eq!(after, Some(KnobLevels::default().with_level(0, 2)));
    }

    #[test]
    fn dependent_knobs_are_shown_together() {
        let knobs = vec![
            Knob::new("count", [0.0, 1.0, 2.0]),
            Knob::new("size", [1.0, 2.0]).needing("count", 1),
            Knob::new("other", [0.0, 1.0]),
        ];
        let space = KnobSpace::new(knobs).expect("a valid space");
        let shown = levels_to_show(&space);
        let pairs: std::collections::BTreeSet<_> =
            shown.iter().map(|settings| (settings.level(0), settings.level(1))).collect();
        assert!(
            [(1, 0), (1, 1), (2, 0), (2, 1)].iter().all(|pair| pairs.contains(pair)),
            "{pairs:?}"
        );
        assert!(
            shown.iter().all(|settings| space.contains(*settings))
                && shown.iter().any(|settings| settings.level(2) == 1)
        );
        assert!(WarmKnobs::new(KnobSpace::default()).levels.is_empty());
    }

    #[test]
    fn whole_settings_are_shown_once_and_within_the_space() {
        let knobs = vec![Knob::new("one", [0.0, 1.0]), Knob::new("two", [0.0, 1.0])];
        let warm = WarmKnobs::new(KnobSpace::new(knobs).expect("a valid space"));
        let both = KnobLevels::default().with_level(0, 1).with_level(1, 1);
        let shown = warm.levels.len();
        assert!(!warm.levels.contains(&both));
        let warm = warm.with_settings([both, both, KnobLevels::from_bits(u128::MAX)]);
        assert_eq!((warm.levels.len(), warm.levels.last()), (shown + 1, Some(&both)));
    }

    #[test]
    fn it_waits_for_the_compiler_at_start_and_end() {
        let (_, _, quick) = run(None, |_| false);
        let (_, _, slow) = run(None, |frame| frame < 10 || (20..40).contains(&frame));
        // Ten frames later at the start, and then not before the second wait is over.
        assert!(slow >= quick + 10 && slow > 40, "{quick} frames, then {slow}");
    }
}
