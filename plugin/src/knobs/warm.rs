//! Compiles what knobs' levels need before it is needed.
//!
//! While a pipeline is not compiled, Bevy leaves out what it draws: the first switch to a level
//! would show a picture with parts missing, or black.

use std::sync::Arc;

use bevy::app::{App, PostUpdate};
use bevy::camera::Camera;
use bevy::ecs::prelude::*;
use bevy::log::warn;
use bevy::platform::time::Instant;

use super::{KnobSettings, KnobSpace, KnobSystems, RenderSettings};
use crate::pipelines::PipelinesBusy;

/// Frames in a row without a pipeline in work after which all are there: what the renderer says
/// lags up to two frames behind the settings, and what one pass draws may call for the next one's
/// pipeline.
const QUIET_FRAMES: u32 = 4;
/// A compiler that has not come to its end after so many seconds will not: a broken shader must not
/// keep an app behind its loading screen.
const LONGEST_WAIT_SECONDS: f32 = 120.0;

/// Shows each level of each knob on this camera, one a frame, and waits until all that they need is
/// compiled; then puts the camera's settings back and removes itself. From then on no switch of a
/// level shows a partial picture.
///
/// While it is there it owns the camera's [`KnobSettings`], and the picture is not fit to be seen:
/// cover it with a loading screen, and give the camera its [map](crate::control::FrontierMapHandle)
/// when this is gone. A camera that had no settings is left at the best ones.
///
/// Pipelines follow what is in view: let the camera see each kind of material that the app has
/// (opaque, alpha-masked, …). A camera that is not active waits.
#[derive(Component, Clone, Debug)]
pub struct WarmKnobs {
    space: Arc<KnobSpace>,
    levels: Vec<RenderSettings>,
    phase: Phase,
    before: Option<KnobSettings>,
    quiet_frames: u32,
    waiting_since: Option<Instant>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The cheapest settings, until the scene itself is there: before, levels find nothing to
    /// compile for.
    Begin,
    /// The level that is shown.
    Level(usize),
    /// The camera's own settings, until the last pipeline is there.
    End,
}

impl WarmKnobs {
    /// Warms every level of `space`.
    pub fn new(space: impl Into<Arc<KnobSpace>>) -> Self {
        let space = space.into();
        let levels = levels_to_show(&space);
        Self {
            space,
            levels,
            phase: Phase::Begin,
            before: None,
            quiet_frames: 0,
            waiting_since: None,
        }
    }

    /// Share of the levels that were shown, 0 to 1. Stays at 1 while the last pipelines compile.
    pub fn progress(&self) -> f32 {
        match self.phase {
            Phase::Begin => 0.0,
            Phase::Level(shown) => shown as f32 / self.levels.len() as f32,
            Phase::End => 1.0,
        }
    }

    /// The settings for this frame; `None` when all is done.
    fn step(&mut self, busy: bool) -> Option<KnobSettings> {
        match self.phase {
            Phase::Begin => {
                if self.has_settled(busy) {
                    self.show(0);
                }
            }
            Phase::Level(shown) => self.show(shown + 1),
            Phase::End => {
                if self.has_settled(busy) {
                    return None;
                }
            }
        }
        let settings = match (self.phase, &self.before) {
            (Phase::Level(shown), _) => self.levels[shown],
            (Phase::End, Some(before)) => return Some(before.clone()),
            (Phase::Begin, _) => self.space.lowest(),
            (Phase::End, None) => self.space.highest(),
        };
        Some(KnobSettings { space: Arc::clone(&self.space), settings })
    }

    fn show(&mut self, level: usize) {
        self.phase = if level < self.levels.len() { Phase::Level(level) } else { Phase::End };
        (self.quiet_frames, self.waiting_since) = (0, None);
    }

    /// Whether nothing compiles any more, or it has taken too long.
    fn has_settled(&mut self, busy: bool) -> bool {
        self.quiet_frames = if busy { 0 } else { self.quiet_frames + 1 };
        let too_long = self.waiting_since.get_or_insert_with(Instant::now).elapsed().as_secs_f32()
            > LONGEST_WAIT_SECONDS;
        if too_long {
            warn!(
                "pipelines still compile after {LONGEST_WAIT_SECONDS} s: going on without, switches of knobs may flicker"
            );
        }
        too_long || self.quiet_frames >= QUIET_FRAMES
    }
}

/// Every level of every knob, the other knobs at their cheapest, which keeps the warm-up short. A
/// knob that needs another one is shown with each level of that one: the two may share a pipeline.
fn levels_to_show(space: &KnobSpace) -> Vec<RenderSettings> {
    let mut shown = Vec::new();
    for (index, knob) in space.knobs().iter().enumerate() {
        for base in space.cheapest_with(knob) {
            shown.extend((0..knob.levels.len()).map(|level| base.with_level(index, level)));
        }
    }
    shown
}

pub(super) fn build(app: &mut App) {
    // Need the settings in place before they are applied, so that every frame shows one step.
    app.add_systems(PostUpdate, warm_knobs.before(KnobSystems::Apply));
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
            Some(wanted) if settings != Some(&wanted) => {
                commands.entity(entity).insert(wanted);
            }
            Some(_) => {}
            None => {
                commands.entity(entity).remove::<WarmKnobs>();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::MinimalPlugins;

    use super::*;
    use crate::knobs::{Knob, KnobDriver, KnobPlugin, Level, RegisterKnob};

    /// Notes the levels that it was set to.
    struct Noting;

    #[derive(Resource, Default)]
    struct Noted(Vec<f64>);

    impl KnobDriver for Noting {
        fn knob(&self) -> Knob {
            Knob::new("noting", [1.0, 2.0, 3.0])
        }

        fn apply(&self, world: &mut World, _: Entity, level: &Level) {
            world.get_resource_or_init::<Noted>().0.push(level.value);
        }
    }

    fn run(
        before: Option<RenderSettings>,
        busy: impl Fn(usize) -> bool,
    ) -> (Vec<f64>, Option<RenderSettings>, usize) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, KnobPlugin)).register_knob(Noting);
        let says = PipelinesBusy::new(true);
        app.insert_resource(says.clone());
        let all =
            app.world().resource::<crate::knobs::KnobRegistry>().space().expect("a sound registry");
        let space = Arc::new(all.subset(["noting"]).expect("the knob above"));
        let camera =
            app.world_mut().spawn((Camera::default(), WarmKnobs::new(Arc::clone(&space)))).id();
        if let Some(settings) = before {
            app.world_mut().entity_mut(camera).insert(KnobSettings { space, settings });
        }
        let mut frames = 0;
        while app.world().get::<WarmKnobs>(camera).is_some() {
            says.set(busy(frames));
            app.update();
            frames += 1;
            assert!(frames < 100, "the warm-up never ends");
        }
        let settings = app.world().get::<KnobSettings>(camera).map(|settings| settings.settings);
        (app.world().resource::<Noted>().0.clone(), settings, frames)
    }

    #[test]
    fn every_level_is_shown_and_the_settings_come_back() {
        let middle = RenderSettings::default().with_level(0, 1);
        let (shown, after, _) = run(Some(middle), |_| false);
        assert_eq!(shown, [1.0, 2.0, 3.0, 2.0]);
        assert_eq!(after, Some(middle));
    }

    #[test]
    fn without_settings_the_best_are_left() {
        let (shown, after, _) = run(None, |_| false);
        assert_eq!(shown, [1.0, 2.0, 3.0]);
        assert_eq!(after, Some(RenderSettings::default().with_level(0, 2)));
    }

    #[test]
    fn knobs_that_need_each_other_are_shown_together() {
        let knobs = vec![
            Knob::new("count", [0.0, 1.0, 2.0]),
            Knob::new("size", [1.0, 2.0]).needing("count", 1),
            Knob::new("other", [0.0, 1.0]),
        ];
        let space = KnobSpace::new(knobs).expect("a sound space");
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
    fn it_waits_for_the_compiler_at_both_ends() {
        let (_, _, quick) = run(None, |_| false);
        let (_, _, slow) = run(None, |frame| frame < 10 || (20..40).contains(&frame));
        // Ten frames later at the start, and then not before the second pause is over.
        assert!(slow >= quick + 10 && slow > 40, "{quick} frames, then {slow}");
    }
}
