//! The available meters, and the choice of the one that covers the rendering device. A new meter is
//! one entry in [`METERS`].

use crate::power::{CpuTimeMeter, MeterError, PowerMeter};
use crate::units::Watts;

/// Kind of the rendering adapter, for the choice of a meter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum AdapterKind {
    /// Software rendering on the CPU (lavapipe, WARP, SwiftShader).
    Software,
    /// A GPU.
    Hardware,
    /// Unknown, or no renderer.
    #[default]
    Unknown,
}

/// The rendering adapter, as described by the caller: this module does not depend on the renderer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Adapter {
    /// CPU or GPU.
    pub kind: AdapterKind,
    /// Name reported by the graphics API, such as "NVIDIA GeForce RTX 3080". Empty where unknown.
    pub name: String,
    /// PCI address, `domain:bus:device.function`, such as "0000:01:00.0". Empty where unknown.
    /// Distinguishes boards of the same name.
    pub pci_bus_id: String,
}

/// Why no meter was opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OpenMeterError {
    /// No meter has this name.
    #[error("there is no power meter called \"{name}\"; known: {}", known_meters().join(", "))]
    UnknownName {
        /// The requested name.
        name: String,
    },
    /// The part after `=` is invalid for this meter.
    #[error("{meter}: \"{parameter}\" is not a valid parameter: {expected}")]
    Parameter {
        /// Name of the meter.
        meter: String,
        /// The text after `=`.
        parameter: String,
        /// The valid parameters, in words.
        expected: String,
    },
    /// The meter is known but gives no reading on this machine.
    #[error(transparent)]
    Meter(#[from] MeterError),
    /// No meter covers the rendering device.
    #[error("no power meter for this adapter: {}", reasons.join("; "))]
    NoneSuits {
        /// One reason per meter, in the order tried.
        reasons: Vec<String>,
    },
}

/// A known meter, with its state on this machine.
#[cfg(any(test, feature = "meter-tools"))]
pub struct SurveyedMeter {
    /// Name, as [`open`] accepts it.
    pub name: &'static str,
    /// Syntax of its argument to [`open`], such as `cpu-time[=WATTS_PER_CORE]`.
    pub usage: &'static str,
    /// The opened meter, or why it is not available.
    pub meter: Result<Box<dyn PowerMeter>, MeterError>,
}

/// A kind of meter, with its constructors.
struct MeterKind {
    name: &'static str,
    usage: &'static str,
    /// Opens it with the text after `=`.
    open: fn(Option<&str>) -> Result<Box<dyn PowerMeter>, OpenMeterError>,
    /// Opens it for the rendering device; an error says why it does not cover that device.
    open_for: fn(&Adapter) -> Result<Box<dyn PowerMeter>, MeterError>,
}

/// All meters in the order of detection: measured before modelled.
const METERS: &[MeterKind] = &[
    MeterKind {
        name: "nvml",
        usage: "nvml[=INDEX|=BOARD NAME]",
        open: open_nvml,
        open_for: open_nvml_for,
    },
    MeterKind {
        name: CpuTimeMeter::NAME,
        usage: "cpu-time[=WATTS_PER_CORE]",
        open: open_cpu_time,
        open_for: open_cpu_time_for,
    },
];

/// Syntax of each meter's argument to [`open`], in the order of detection.
fn known_meters() -> Vec<&'static str> {
    METERS.iter().map(|kind| kind.usage).collect()
}

/// Opens the first meter that covers the rendering adapter and gives a reading. May take some
/// hundred milliseconds: do not call it on the main thread.
///
/// Meters of other devices are never used: on a machine with an NVIDIA board that renders in
/// software or on another vendor's GPU, NVML would meter an idle board.
///
/// # Errors
/// [`OpenMeterError::NoneSuits`], with a reason per meter.
pub fn detect(adapter: &Adapter) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    let mut reasons = Vec::new();
    for kind in METERS {
        match (kind.open_for)(adapter).and_then(with_first_reading) {
            Ok(meter) => return Ok(meter),
            Err(error) => reasons.push(error.to_string()),
        }
    }
    Err(OpenMeterError::NoneSuits { reasons })
}

/// Opens a meter by name, with an optional parameter after `=`: `nvml`, `nvml=1` (board index or
/// name), `cpu-time`, `cpu-time=5.0` (watts per busy core). The caller decides whether it covers
/// the rendering device. May take some hundred milliseconds.
///
/// # Errors
/// [`OpenMeterError`] when the name is unknown, the parameter is invalid, or the meter gives no
/// reading on this machine.
pub fn open(name: &str) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    let (plain, parameter) = match name.split_once('=') {
        Some((plain, parameter)) => (plain.trim(), Some(parameter.trim())),
        None => (name.trim(), None),
    };
    let Some(kind) = METERS.iter().find(|kind| kind.name == plain) else {
        return Err(OpenMeterError::UnknownName { name: plain.to_owned() });
    };
    Ok(with_first_reading((kind.open)(parameter)?)?)
}

/// Opens every known meter with its defaults and reports the result of each, in the order of
/// detection. May take some hundred milliseconds.
#[cfg(any(test, feature = "meter-tools"))]
pub fn survey() -> Vec<SurveyedMeter> {
    METERS
        .iter()
        .map(|kind| {
            let meter = (kind.open)(None).and_then(|meter| Ok(with_first_reading(meter)?)).map_err(
                |error| match error {
                    OpenMeterError::Meter(error) => error,
                    other => MeterError::unavailable(kind.name, other.to_string()),
                },
            );
            SurveyedMeter { name: kind.name, usage: kind.usage, meter }
        })
        .collect()
}

/// Takes one reading: some libraries initialise successfully and then reject every query.
fn with_first_reading(mut meter: Box<dyn PowerMeter>) -> Result<Box<dyn PowerMeter>, MeterError> {
    crate::power::window::read(meter.as_mut())?;
    Ok(meter)
}

#[cfg(feature = "nvml")]
fn open_nvml(parameter: Option<&str>) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    use crate::power::{BoardChoice, NvmlMeter};
    let choice = match parameter {
        None => BoardChoice::Index(0),
        Some("") => {
            return Err(OpenMeterError::Parameter {
                meter: NvmlMeter::NAME.to_owned(),
                parameter: String::new(),
                expected: "a board's index from 0, or its name".to_owned(),
            });
        }
        Some(text) => {
            text.parse().map_or_else(|_| BoardChoice::Name(text.to_owned()), BoardChoice::Index)
        }
    };
    Ok(Box::new(NvmlMeter::open(&choice)?))
}

#[cfg(feature = "nvml")]
fn open_nvml_for(adapter: &Adapter) -> Result<Box<dyn PowerMeter>, MeterError> {
    use crate::power::NvmlMeter;
    if adapter.kind == AdapterKind::Software {
        return Err(MeterError::unavailable(
            NvmlMeter::NAME,
            "the adapter renders on the CPU, which this meter does not cover",
        ));
    }
    Ok(Box::new(NvmlMeter::for_adapter(adapter)?))
}

#[cfg(not(feature = "nvml"))]
fn open_nvml(_parameter: Option<&str>) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    Err(nvml_disabled().into())
}

#[cfg(not(feature = "nvml"))]
fn open_nvml_for(_adapter: &Adapter) -> Result<Box<dyn PowerMeter>, MeterError> {
    Err(nvml_disabled())
}

#[cfg(not(feature = "nvml"))]
fn nvml_disabled() -> MeterError {
    MeterError::unavailable("nvml", "built without the feature `nvml`; enable it")
}

fn open_cpu_time(parameter: Option<&str>) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    let Some(text) = parameter else { return Ok(Box::new(CpuTimeMeter::default())) };
    let invalid = |expected: String| OpenMeterError::Parameter {
        meter: CpuTimeMeter::NAME.to_owned(),
        parameter: text.to_owned(),
        expected,
    };
    let watts = text.parse().map_err(|_| invalid("watts per busy core, such as 5.0".to_owned()))?;
    let meter = CpuTimeMeter::with_watts_per_core(Watts(watts))
        .map_err(|error| invalid(error.to_string()))?;
    Ok(Box::new(meter))
}

fn open_cpu_time_for(adapter: &Adapter) -> Result<Box<dyn PowerMeter>, MeterError> {
    match adapter.kind {
        AdapterKind::Software => Ok(Box::new(CpuTimeMeter::default())),
        AdapterKind::Hardware => Err(MeterError::unavailable(
            CpuTimeMeter::NAME,
            "the adapter is a GPU, which CPU time does not cover",
        )),
        AdapterKind::Unknown => Err(MeterError::unavailable(
            CpuTimeMeter::NAME,
            "the adapter is not known to render on the CPU; request this meter by name",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::Provenance;

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let message = open("wattmeter").err().expect("there is no such meter").to_string();
        for part in ["\"wattmeter\"", "nvml", "cpu-time[=WATTS_PER_CORE]"] {
            assert!(message.contains(part), "{message}");
        }
        assert!(matches!(open(""), Err(OpenMeterError::UnknownName { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn a_parameter_reaches_its_meter() {
        let info = open("cpu-time=5.0").expect("every unix has the clock").info();
        assert!(info.description.contains("× 5 W per busy core"), "{}", info.description);
        for bad in ["cpu-time=", "cpu-time=much", "cpu-time=-1", "cpu-time=nan", "cpu-time=inf"] {
            assert!(matches!(open(bad), Err(OpenMeterError::Parameter { .. })), "{bad}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn software_rendering_is_metered_on_the_cpu_whatever_boards_are_present() {
        let adapter = Adapter {
            kind: AdapterKind::Software,
            name: "llvmpipe (LLVM 19, 256 bits)".to_owned(),
            ..Adapter::default()
        };
        let info = detect(&adapter).expect("every unix has the clock").info();
        assert_eq!((info.name.as_str(), info.provenance), ("cpu-time", Provenance::Modelled));
    }

    #[test]
    fn a_gpu_of_another_vendor_gets_reasons_and_no_meter() {
        let adapter = Adapter {
            kind: AdapterKind::Hardware,
            name: "Some Other GPU".to_owned(),
            ..Adapter::default()
        };
        let message = detect(&adapter).err().expect("no meter covers it").to_string();
        assert!(message.contains("nvml:") && message.contains("cpu-time:"), "{message}");
    }

    #[test]
    fn the_survey_lists_every_meter_with_info_or_reason() {
        let found = survey();
        assert_eq!(found.iter().map(|entry| entry.name).collect::<Vec<_>>(), ["nvml", "cpu-time"]);
        for entry in found {
            match entry.meter {
                Ok(meter) => assert_eq!(meter.info().name, entry.name),
                Err(error) => assert!(error.to_string().starts_with(entry.name), "{error}"),
            }
        }
    }
}
