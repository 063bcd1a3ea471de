//! The latest switches of settings.

use std::collections::VecDeque;
use std::sync::Arc;

use bevy::prelude::*;
use bevy_frugal_gi::control::SettingsSwitched;
use bevy_frugal_gi::knobs::{KnobSettings, KnobSpace};

use super::HudSettings;
use super::text::switch_line;

/// Most entries kept, of all cameras together.
const MAX_ENTRIES: usize = 64;

/// A transition of settings, so far.
struct Entry {
    switch: SettingsSwitched,
    /// When it began, in seconds since the app's start.
    seconds: f64,
    space: Arc<KnobSpace>,
}

/// Switches of all cameras, the latest last.
#[derive(Resource, Default)]
pub(super) struct SwitchLog {
    entries: VecDeque<Entry>,
}

impl SwitchLog {
    /// Adds a switch. Steps on the way to one target are one entry.
    fn add(&mut self, switch: SettingsSwitched, space: &Arc<KnobSpace>, seconds: f64) {
        let is_its = |entry: &&mut Entry| entry.switch.camera == switch.camera;
        if let Some(Entry { switch: last, space: known, .. }) =
            self.entries.iter_mut().rev().find(is_its)
            && (last.to, last.target) == (switch.from, switch.target)
            && Arc::ptr_eq(known, space)
        {
            last.to = switch.to;
            return;
        }
        if self.entries.len() == MAX_ENTRIES {
            self.entries.pop_front();
        }
        self.entries.push_back(Entry { switch, seconds, space: Arc::clone(space) });
    }

    /// The last `count` switches of a camera as lines, the latest first. Each names `knobs` knobs
    /// and counts the others.
    pub(super) fn lines(
        &self,
        camera: Entity,
        count: usize,
        knobs: usize,
    ) -> impl Iterator<Item = String> {
        let own = self.entries.iter().rev().filter(move |entry| entry.switch.camera == camera);
        let line = move |Entry { switch, seconds, space }: &Entry| {
            let is_done = switch.to == switch.target;
            switch_line(space, *seconds, (switch.from, switch.to), is_done, knobs)
        };
        own.take(count).map(line)
    }
}

/// Adds a switch.
pub(super) fn record(
    switch: On<SettingsSwitched>,
    settings: Res<HudSettings>,
    time: Option<Res<Time<Real>>>,
    cameras: Query<&KnobSettings>,
    mut log: ResMut<SwitchLog>,
) {
    if settings.visible
        && let Ok(knobs) = cameras.get(switch.camera)
    {
        log.add(*switch, &knobs.space, time.map_or(0.0, |time| time.elapsed_secs_f64()));
    }
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::knobs::KnobLevels;

    use super::*;
    use crate::testing;

    fn entity(number: u32) -> Entity {
        Entity::from_raw_u32(number).expect("an entity")
    }

    fn at(samples: usize) -> KnobLevels {
        KnobLevels::default().with_level(0, samples)
    }

    #[test]
    fn steps_to_one_target_are_one_line() {
        let (camera, other) = (entity(1), entity(2));
        let (space, mut log) = (Arc::new(testing::space()), SwitchLog::default());
        let lines = |log: &SwitchLog, camera, count| {
            log.lines(camera, count, 2).collect::<Vec<_>>().join("\n")
        };
        let step = |from, to, target| SettingsSwitched {
            camera,
            from: at(from),
            to: at(to),
            target: at(target),
        };
        log.add(step(0, 1, 2), &space, 1.0);
        assert_eq!(lines(&log, camera, 9), "1.0 s  samples 0 > 4 ...");
        log.add(SettingsSwitched { camera: other, ..step(4, 3, 3) }, &space, 1.1);
        log.add(step(1, 2, 2), &space, 1.2);
        assert_eq!(lines(&log, camera, 9), "1.0 s  samples 0 > 8");
        log.add(step(2, 1, 1), &space, 2.0);
        assert_eq!(lines(&log, camera, 9), "2.0 s  samples 8 > 4\n1.0 s  samples 0 > 8");
        assert_eq!(lines(&log, camera, 1), "2.0 s  samples 8 > 4");
        assert_eq!(lines(&log, other, 9), "1.1 s  samples 32 > 16");
        assert_eq!(lines(&log, camera, 0), "");
    }

    #[test]
    fn an_endless_run_keeps_the_latest_switches_only() {
        let (camera, mut log) = (entity(1), SwitchLog::default());
        for second in 0..1000 {
            let (from, to) = (at(second % 2), at((second + 1) % 2));
            let switch = SettingsSwitched { camera, from, to, target: to };
            log.add(switch, &Arc::new(testing::space()), second as f64);
        }
        assert_eq!(log.entries.len(), MAX_ENTRIES);
        let last = log.lines(camera, 9, 1).next().expect("a line");
        assert!(last.starts_with("999.0 s"), "{last}");
    }
}
