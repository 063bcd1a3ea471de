//! The available meters, and the choice of the one that covers the rendering device. A new meter is
//! one entry in [`METERS`].

#[cfg(feature = "nvml")]
use crate::power::adapter::{RENDERS_ON_CPU, vendor};
#[cfg(not(any(windows, target_os = "macos")))]
use crate::power::sysfs::battery::KIND as BATTERY;
#[cfg(any(windows, target_os = "macos"))]
use crate::power::sysfs::notebook::KIND as BATTERY;
use crate::power::sysfs::{SysRoot, gpu, jetson, rapl};
use crate::power::{Adapter, AdapterKind, CpuTimeMeter, MeterError, PowerMeter};
use crate::units::Watts;

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

/// A meter that was opened by name.
pub(crate) type Opened = Result<Box<dyn PowerMeter>, OpenMeterError>;

/// A kind of meter, with its constructors.
pub(crate) trait MeterKind: Sync {
    /// Name, as [`open`] accepts it.
    fn name(&self) -> &'static str;

    /// Syntax of its argument to [`open`].
    fn usage(&self) -> &'static str;

    /// Opens it with the text after `=`.
    fn open(&self, root: &SysRoot, parameter: Option<&str>) -> Opened;

    /// Opens it for the rendering device; an error says why it does not cover that device.
    fn open_for(
        &self,
        root: &SysRoot,
        adapter: &Adapter,
    ) -> Result<Box<dyn PowerMeter>, MeterError>;
}

/// All meters in the order of detection: measured before modelled, and of the measured ones first
/// those that cover the GPU alone, then its package, its module, and the machine.
const METERS: &[&dyn MeterKind] =
    &[&Nvml, &gpu::AMD, &gpu::INTEL, &rapl::KIND, &jetson::KIND, &BATTERY, &CpuTime];

/// Syntax of each meter's argument to [`open`], in the order of detection.
fn known_meters() -> Vec<&'static str> {
    METERS.iter().map(|kind| kind.usage()).collect()
}

/// Opens the first meter that covers the rendering adapter and gives a reading. May take seconds:
/// do not call it on the main thread.
///
/// Meters of other devices are never used: on a machine with an NVIDIA board that renders in
/// software or on another vendor's GPU, NVML would meter an idle board. Software rendering has the
/// CPU time of this process: meters of the whole package or machine, which contain all programs, are
/// for those who name them.
///
/// # Errors
/// [`OpenMeterError::NoneSuits`], with a reason per meter.
pub fn detect(adapter: &Adapter) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    detect_in(&SysRoot::default(), adapter)
}

/// The same on a system under another root.
fn detect_in(root: &SysRoot, adapter: &Adapter) -> Opened {
    let mut reasons = Vec::new();
    for kind in METERS {
        match kind.open_for(root, adapter).and_then(with_first_reading) {
            Ok(meter) => return Ok(meter),
            Err(error) => reasons.push(error.to_string()),
        }
    }
    Err(OpenMeterError::NoneSuits { reasons })
}

/// Opens a meter by name, with an optional parameter after `=`: `nvml`, `nvml=1` (board index or
/// name), `amdgpu=card0`, `battery`, `cpu-time=5.0` (watts per busy core). The caller decides whether
/// it covers the rendering device. May take seconds.
///
/// # Errors
/// [`OpenMeterError`] when the name is unknown, the parameter is invalid, or the meter gives no
/// reading on this machine.
pub fn open(name: &str) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    open_in(&SysRoot::default(), name)
}

/// The same on a system under another root.
fn open_in(root: &SysRoot, name: &str) -> Opened {
    let (plain, parameter) = match name.split_once('=') {
        Some((plain, parameter)) => (plain.trim(), Some(parameter.trim())),
        None => (name.trim(), None),
    };
    let Some(kind) = METERS.iter().find(|kind| kind.name() == plain) else {
        return Err(OpenMeterError::UnknownName { name: plain.to_owned() });
    };
    Ok(with_first_reading(kind.open(root, parameter)?)?)
}

/// Opens every known meter with its defaults and reports the result of each, in the order of
/// detection. May take seconds.
#[cfg(any(test, feature = "meter-tools"))]
pub fn survey() -> Vec<SurveyedMeter> {
    survey_in(&SysRoot::default())
}

/// The same of a system under another root.
#[cfg(any(test, feature = "meter-tools"))]
fn survey_in(root: &SysRoot) -> Vec<SurveyedMeter> {
    METERS
        .iter()
        .map(|kind| {
            let opened = kind.open(root, None).and_then(|meter| Ok(with_first_reading(meter)?));
            let meter = opened.map_err(|error| match error {
                OpenMeterError::Meter(error) => error,
                other => MeterError::unavailable(kind.name(), other.to_string()),
            });
            SurveyedMeter { name: kind.name(), usage: kind.usage(), meter }
        })
        .collect()
}

/// Takes one reading: some libraries initialise successfully and then reject every query.
fn with_first_reading(mut meter: Box<dyn PowerMeter>) -> Result<Box<dyn PowerMeter>, MeterError> {
    crate::power::window::read(meter.as_mut())?;
    Ok(meter)
}

struct Nvml;

impl MeterKind for Nvml {
    fn name(&self) -> &'static str {
        "nvml"
    }

    fn usage(&self) -> &'static str {
        "nvml[=INDEX|=BOARD NAME]"
    }

    fn open(&self, _: &SysRoot, parameter: Option<&str>) -> Opened {
        open_nvml(parameter)
    }

    fn open_for(&self, _: &SysRoot, adapter: &Adapter) -> Result<Box<dyn PowerMeter>, MeterError> {
        open_nvml_for(adapter)
    }
}

struct CpuTime;

impl MeterKind for CpuTime {
    fn name(&self) -> &'static str {
        CpuTimeMeter::NAME
    }

    fn usage(&self) -> &'static str {
        "cpu-time[=WATTS_PER_CORE]"
    }

    fn open(&self, _: &SysRoot, parameter: Option<&str>) -> Opened {
        open_cpu_time(parameter)
    }

    fn open_for(&self, _: &SysRoot, adapter: &Adapter) -> Result<Box<dyn PowerMeter>, MeterError> {
        open_cpu_time_for(adapter)
    }
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
        return Err(MeterError::unavailable(NvmlMeter::NAME, RENDERS_ON_CPU));
    }
    // Without loading the library, which would start the driver of an idle board.
    if adapter.vendor().is_some_and(|other| other != vendor::NVIDIA) {
        return Err(MeterError::unavailable(
            NvmlMeter::NAME,
            "the adapter is another vendor's, which this meter does not cover",
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
#[path = "detect_tests.rs"]
mod tests;
