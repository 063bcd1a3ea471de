//! The samples of the documents, word for word, so that they compile. A test looks for each of them
//! here.

#![allow(dead_code, unused_imports)]

// README.md and docs/using.md
mod readme {
    fn sample() {
        use bevy::prelude::*;
        use bevy_frugal_gi::prelude::*;

        App::new()
            .add_plugins((DefaultPlugins, FrugalGiPlugins))
            .insert_resource(FrameRateLimit { hertz: Some(60.0) }) // the frame rate of the map
            .add_systems(Startup, |mut commands: Commands, assets: Res<AssetServer>| {
                commands.spawn((
                    Camera3d::default(),
                    FrugalGi::default(), // global illumination on this camera
                    PowerController(assets.load("maps/courtyard.pareto.ron")), // and the controller
                    Budget::power(Watts(7.0)),
                ));
            })
            .run();
    }
}

// docs/using.md
mod using_currencies {
    use std::time::Duration;

    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;

    fn two_more_hours(mut budget: Single<&mut Budget>, time: Res<Time<Real>>) {
        **budget = Budget::error(0.01)
            .with_battery_until(time.elapsed() + Duration::from_secs(2 * 3600))
            .with_frame_time(Duration::from_millis(16));
    }
}

// docs/using.md
mod using_selection {
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;

    fn watch(selections: Query<&Selection, Changed<Selection>>) {
        for selection in &selections {
            match selection.status {
                ControlStatus::Active(Outcome::Met) => {}
                other => info!("{other:?}, predicted: {:?}", selection.predicted),
            }
        }
    }
}

// docs/using.md
mod using_knob_bounds {
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;

    fn pin(mut bounds: Single<&mut KnobBounds>) {
        bounds
            .pin("resolution_scale", 5)
            .at_least("antialiasing", 1)
            .at_most("shadow_map_resolution", 2);
    }
}

// docs/using.md
mod using_error_meter {
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;

    fn measure(mut commands: Commands, camera: Single<Entity, With<FrugalGi>>) {
        commands.entity(*camera).insert(ErrorMeter::default());
    }
}

// docs/using.md
mod using_stage {
    fn sample() {
        use bevy::prelude::*;
        use bevy_frugal_gi::prelude::*;

        use bevy_frugal_gi::stage::on_stage;

        App::new().add_plugins((on_stage(DefaultPlugins), FrugalGiPlugins)).run();
    }
}

// docs/using.md
mod using_log {
    fn sample() {
        use bevy::prelude::*;
        use bevy_frugal_gi::prelude::*;
        use bevy_frugal_gi_tools::ControlLogPlugin;

        App::new()
            .add_plugins((DefaultPlugins, FrugalGiPlugins, ControlLogPlugin::new("control.csv")))
            .run();
    }
}

// docs/using.md
mod using_cut {
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;

    fn teleport(
        mut commands: Commands,
        mut camera: Single<(Entity, &mut Transform), With<FrugalGi>>,
    ) {
        let (entity, transform) = &mut *camera;
        **transform = Transform::from_xyz(10.0, 1.7, 3.0).looking_at(Vec3::ZERO, Vec3::Y);
        commands.entity(*entity).insert(CameraCut);
    }
}

// docs/using.md
mod using_recording {
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;
    use bevy_frugal_gi_tools::{CameraRecorderPlugin, RecordCamera};

    fn sample() {
        App::new()
            .add_plugins((
                DefaultPlugins,
                FrugalGiPlugins,
                CameraRecorderPlugin::new("walk.cameras"),
            ))
            .add_systems(Startup, |mut commands: Commands| {
                commands.spawn((Camera3d::default(), FrugalGi::default(), RecordCamera));
            })
            .run();
    }
}

// docs/using.md
mod using_hud {
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;
    use bevy_frugal_gi_tools::{HudPlugin, HudSettings};

    fn sample() {
        App::new()
            .add_plugins((DefaultPlugins, FrugalGiPlugins, HudPlugin))
            .insert_resource(HudSettings { key: Some(KeyCode::F1), ..default() })
            .run();
    }
}

// docs/using.md
mod knobs_by_hand {
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;

    use bevy_frugal_gi::knobs::KnobRegistry;

    fn cheapest(
        mut commands: Commands,
        registry: Res<KnobRegistry>,
        camera: Single<Entity, With<FrugalGi>>,
    ) {
        let space = registry.space().expect("valid knobs");
        let settings = space.lowest();
        commands.entity(*camera).insert(KnobSettings { space: space.into(), settings });
    }
}

// docs/using.md
mod own_knob {
    fn sample() {
        use bevy::core_pipeline::tonemapping::DebandDither;
        use bevy::prelude::*;
        use bevy_frugal_gi::knobs::{FieldKnob, Knob, KnobField};
        use bevy_frugal_gi::prelude::*;

        /// Dithering against colour banding.
        fn dithering() -> FieldKnob {
            FieldKnob::new(
                // Cheapest first. The label is read on the command line and in files.
                Knob::labelled("dithering", [(0.0, "off"), (1.0, "on")]),
                KnobField::new(
                    |dither: &mut DebandDither| dither,
                    |level, _| {
                        if level.value > 0.0 {
                            DebandDither::Enabled
                        } else {
                            DebandDither::Disabled
                        }
                    },
                ),
            )
        }

        App::new().add_plugins((DefaultPlugins, FrugalGiPlugins)).register_knob(dithering());
    }
}

// docs/power.md
mod meter {
    use bevy::app::PluginGroupBuilder;
    use bevy::prelude::*;
    use bevy_frugal_gi::prelude::*;

    use bevy_frugal_gi::power::{MeterChoice, PowerPlugin};

    fn sample() -> PluginGroupBuilder {
        FrugalGiPlugins
            .set(PowerPlugin { meter: MeterChoice::Named("cpu-time=5.0".into()), ..default() })
    }
}
