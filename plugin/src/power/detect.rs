//! Which meters there are, and which one meters the device that renders. A new meter is one entry
//! in [`METERS`].

use crate::power::{CpuTimeMeter, MeterError, PowerMeter};
use crate::units::Watts;

/// What the renderer draws with, as far as metering cares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdapterKind {
    /// The processor (lavapipe, WARP, SwiftShader).
    Software,
    /// A GPU.
    Hardware,
    /// Not known, or there is no renderer.
    #[default]
    Unknown,
}

/// The rendering adapter, told by whoever knows the renderer: this module knows none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Adapter {
    /// Processor or GPU.
    pub kind: AdapterKind,
    /// Name as the graphics interface gives it: "NVIDIA GeForce RTX 3080". Empty where unknown.
    pub name: String,
    /// PCI address, `domain:bus:device.function`: "0000:01:00.0". Empty where unknown. Tells twin
    /// boards apart.
    pub pci_bus_id: String,
}

/// Why no meter was opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OpenMeterError {
    /// No meter has this name.
    #[error("there is no power meter called \"{name}\"; known: {}", known_meters().join(", "))]
    UnknownName {
        /// The name asked for.
        name: String,
    },
    /// The part after `=` makes no sense for this meter.
    #[error("{meter}: \"{parameter}\" is no parameter of this meter: {expected}")]
    Parameter {
        /// The meter.
        meter: String,
        /// What was after `=`.
        parameter: String,
        /// What may be.
        expected: String,
    },
    /// The meter is known but gives no reading here.
    #[error(transparent)]
    Meter(#[from] MeterError),
    /// None of the meters covers the device that renders.
    #[error("no power meter for this adapter: {}", reasons.join("; "))]
    NoneSuits {
        /// One reason per meter, in the order tried.
        reasons: Vec<String>,
    },
}

/// A meter of this machine, or why it has none of that kind.
pub struct SurveyedMeter {
    /// Identifier, as [`open`] takes it.
    pub name: &'static str,
    /// How to ask for it: `cpu-time[=WATTS_PER_CORE]`.
    pub usage: &'static str,
    /// The meter, ready to be read, or why there is none.
    pub meter: Result<Box<dyn PowerMeter>, MeterError>,
}

/// A kind of meter: all that the rest of the crate must know to offer it.
struct MeterKind {
    name: &'static str,
    usage: &'static str,
    /// Opens it with the text after `=`.
    open: fn(Option<&str>) -> Result<Box<dyn PowerMeter>, OpenMeterError>,
    /// Opens it for the device that renders, or says why it does not cover that one.
    open_for: fn(&Adapter) -> Result<Box<dyn PowerMeter>, MeterError>,
}

/// All meters, in the order of detection: measured before modelled.
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

/// How to ask [`open`] for each meter, in the order of detection.
pub fn known_meters() -> Vec<&'static str> {
    METERS.iter().map(|kind| kind.usage).collect()
}

/// Opens the first meter that covers the adapter and gives a reading. May take some hundred
/// milliseconds: call it off the main thread.
///
/// A meter of another device is never chosen: on a machine with an NVIDIA board that renders in
/// software or on another vendor's GPU, NVML would meter a board that idles.
///
/// # Errors
/// `NoneSuits`, with a reason per meter.
pub fn detect(adapter: &Adapter) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    let mut reasons = Vec::new();
    for kind in METERS {
        match (kind.open_for)(adapter).and_then(proven) {
            Ok(meter) => return Ok(meter),
            Err(error) => reasons.push(error.to_string()),
        }
    }
    Err(OpenMeterError::NoneSuits { reasons })
}

/// Opens a meter by name, with a parameter after `=` where it takes one: `nvml`, `nvml=1`,
/// `cpu-time`, `cpu-time=5.0`. Whether it covers the device that renders is the caller's business.
/// May take some hundred milliseconds.
///
/// # Errors
/// When the name or the parameter is not known, or the meter gives no reading here.
pub fn open(name: &str) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    let (plain, parameter) = match name.split_once('=') {
        Some((plain, parameter)) => (plain.trim(), Some(parameter.trim())),
        None => (name.trim(), None),
    };
    let Some(kind) = METERS.iter().find(|kind| kind.name == plain) else {
        return Err(OpenMeterError::UnknownName { name: plain.to_owned() });
    };
    Ok(proven((kind.open)(parameter)?)?)
}

/// Every meter that this crate knows, each opened with its defaults, or why it cannot be.
pub fn survey() -> Vec<SurveyedMeter> {
    METERS
        .iter()
        .map(|kind| {
            let meter =
                (kind.open)(None).and_then(|meter| Ok(proven(meter)?)).map_err(
                    |error| match error {
                        OpenMeterError::Meter(error) => error,
                        other => MeterError::unavailable(kind.name, other.to_string()),
                    },
                );
            SurveyedMeter { name: kind.name, usage: kind.usage, meter }
        })
        .collect()
}

/// A meter counts as there once it gave a reading: libraries exist that initialise well and then
/// refuse every query.
fn proven(mut meter: Box<dyn PowerMeter>) -> Result<Box<dyn PowerMeter>, MeterError> {
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
            "the adapter renders on the processor, which this meter does not cover",
        ));
    }
    Ok(Box::new(NvmlMeter::for_adapter(adapter)?))
}

#[cfg(not(feature = "nvml"))]
fn open_nvml(_parameter: Option<&str>) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    Err(without_nvml().into())
}

#[cfg(not(feature = "nvml"))]
fn open_nvml_for(_adapter: &Adapter) -> Result<Box<dyn PowerMeter>, MeterError> {
    Err(without_nvml())
}

#[cfg(not(feature = "nvml"))]
fn without_nvml() -> MeterError {
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
            "not known to render on the processor; ask for this meter by name",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::Provenance;

    #[test]
    fn an_unknown_name_is_answered_with_those_there_are() {
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
    fn software_rendering_is_metered_on_the_processor_whatever_boards_there_are() {
        let adapter = Adapter {
            kind: AdapterKind::Software,
            name: "llvmpipe (LLVM 19, 256 bits)".to_owned(),
            ..Adapter::default()
        };
        let info = detect(&adapter).expect("every unix has the clock").info();
        assert_eq!((info.name.as_str(), info.provenance), ("cpu-time", Provenance::Modelled));
    }

    #[test]
    fn a_gpu_of_another_vendor_gets_no_meter_but_reasons() {
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
