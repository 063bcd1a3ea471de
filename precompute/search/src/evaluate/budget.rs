//! Parsing of budgets, and resolution of percentages on a path.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use frugal_core::control::Budget;
use frugal_core::units::Watts;
use serde::{Deserialize, Serialize};

/// A power limit as requested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PowerBudget {
    /// In watts, above 0 and finite.
    Power(Watts),
    /// A position between the mean powers of the lowest and the highest settings: above 0 (lowest)
    /// and at most 1 (highest).
    Share(f64),
}

impl PowerBudget {
    /// Reads watts, with or without a `W`, or a percentage, whatever the number.
    pub fn read(text: &str) -> Option<Self> {
        let text = text.trim();
        let number = |number: &str| number.trim_end().parse::<f64>().ok();
        match text.strip_suffix('%') {
            Some(percent) => Some(Self::Share(number(percent)? / 100.0)),
            None => {
                Some(Self::Power(Watts(number(text.strip_suffix(['W', 'w']).unwrap_or(text))?)))
            }
        }
    }
}

impl FromStr for PowerBudget {
    type Err = String;

    /// Reads `7W`, `7 W`, `7` or `60%`.
    fn from_str(text: &str) -> Result<Self, String> {
        match Self::read(text) {
            Some(Self::Power(watts)) if !(watts.0 > 0.0 && watts.0.is_finite()) => Err(format!(
                "a power budget of `{text}` cannot be kept: it must be above 0 W and finite"
            )),
            Some(Self::Share(share)) if !(share > 0.0 && share <= 1.0) => Err(format!(
                "a power budget of `{text}` is out of range: a percentage lies above 0% (the lowest settings) and at most at 100% (the highest)"
            )),
            Some(budget) => Ok(budget),
            None => Err(format!(
                "`{text}` is not a power budget: write watts as `7W` or `7`, or a percentage between the lowest and the highest settings as `60%`"
            )),
        }
    }
}

impl fmt::Display for PowerBudget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Power(watts) => write!(f, "{} W", watts.0),
            // Rounded, so that a typed percentage prints as it was typed.
            Self::Share(share) => write!(f, "{}%", (share * 1e8).round() / 1e6),
        }
    }
}

/// Reads an error budget, 1 − SSIM: above 0 and at most 2.
///
/// # Errors
/// When the text is not a number in that range.
pub fn parse_error_budget(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number > 0.0 && number <= 2.0 => Ok(number),
        Ok(_) => Err(format!(
            "an error budget of `{text}` is out of range: 1 − SSIM lies above 0 and at most at 2"
        )),
        Err(_) => Err(format!("`{text}` is not an error budget: write a number such as `0.02`")),
    }
}

/// A request for a limit on power, on error, on both, or on neither.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BudgetRequest {
    /// Limit on power.
    pub power: Option<PowerBudget>,
    /// Limit on error, 1 − SSIM.
    pub error: Option<f64>,
    /// What means are over, seconds; `None` for the default of a budget.
    pub horizon_s: Option<f64>,
}

impl BudgetRequest {
    /// The budget in watts; `lowest` and `highest` are the mean powers of the cheapest and the best
    /// settings on the path.
    pub fn resolve(&self, lowest: Watts, highest: Watts) -> ResolvedBudget {
        let power = self.power.map(|power| match power {
            PowerBudget::Power(watts) => watts,
            PowerBudget::Share(share) => lowest + (highest - lowest) * share,
        });
        let horizon_s = self.horizon_s.unwrap_or(ResolvedBudget::HORIZON_S);
        ResolvedBudget { power_w: power, error: self.error, horizon_s }
    }
}

impl fmt::Display for BudgetRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.power, self.error) {
            (Some(power), Some(error)) => write!(f, "power at most {power}, error at most {error}"),
            (Some(power), None) => write!(f, "power at most {power}"),
            (None, Some(error)) => write!(f, "error at most {error}"),
            (None, None) => write!(f, "no limit"),
        }
    }
}

/// A budget in absolute terms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResolvedBudget {
    /// Limit on the mean power.
    pub power_w: Option<Watts>,
    /// Limit on the mean error, 1 − SSIM.
    pub error: Option<f64>,
    /// What the means are over, seconds.
    pub horizon_s: f64,
}

impl Default for ResolvedBudget {
    fn default() -> Self {
        Self { power_w: None, error: None, horizon_s: Self::HORIZON_S }
    }
}

impl ResolvedBudget {
    /// That of a budget that says none, seconds.
    pub const HORIZON_S: f64 = Budget::HORIZON.as_secs() as f64;

    /// As the controller takes it.
    pub fn limits(&self) -> Budget {
        let horizon = Duration::try_from_secs_f64(self.horizon_s).unwrap_or(Duration::MAX);
        Budget::new(self.power_w, self.error).with_horizon(horizon)
    }

    /// Whether `power` and `error` are within the limits. NaN never is within a limit.
    pub fn keeps(&self, power: Watts, error: f64) -> bool {
        self.power_w.is_none_or(|limit| power <= limit)
            && self.error.is_none_or(|limit| error <= limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn watts_and_percentages_are_read() {
        for text in ["7W", "7", " 7 W ", "7w", "7.0", "0.7e1W"] {
            assert_eq!(text.parse(), Ok(PowerBudget::Power(Watts(7.0))), "{text}");
        }
        assert_eq!("60%".parse(), Ok(PowerBudget::Share(0.6)));
        assert_eq!("100 %".parse(), Ok(PowerBudget::Share(1.0)));
        assert_eq!(parse_error_budget(" 0.02"), Ok(0.02));
    }

    #[test]
    fn malformed_budgets_are_refused_with_their_text() {
        let power = |text: &str| text.parse::<PowerBudget>().map(drop);
        let error = |text: &str| parse_error_budget(text).map(drop);
        type Parse<'a> = &'a dyn Fn(&str) -> Result<(), String>;
        let cases: [(Parse<'_>, &str, &[&str]); 5] = [
            (
                &power,
                "`{}` is not a power budget",
                &["", "W", "%", "seven", "7 kW", "7V", "-", "6 0%", "60%W"],
            ),
            (
                &power,
                "a power budget of `{}` cannot be kept",
                &["0", "-1W", "nan", "NaN W", "inf", "-inf", "1e999", "0W", "-0"],
            ),
            (
                &power,
                "a power budget of `{}` is out of range",
                &["0%", "-5%", "101%", "nan%", "inf%"],
            ),
            (&error, "`{}` is not an error budget", &["", "2%", "little"]),
            (
                &error,
                "an error budget of `{}` is out of range",
                &["0", "-0.1", "nan", "inf", "2.01"],
            ),
        ];
        for (parse, expected, texts) in cases {
            for text in texts {
                let refused = parse(text).expect_err(text);
                assert!(refused.starts_with(&expected.replace("{}", text)), "{refused}");
            }
        }
    }

    #[test]
    fn a_percentage_lies_between_the_lowest_and_the_highest() {
        let request = BudgetRequest { power: Some(PowerBudget::Share(0.6)), ..Default::default() };
        let power = request.resolve(Watts(2.0), Watts(7.0)).power_w.unwrap();
        assert!((power.0 - 5.0).abs() < 1e-12);
        assert_eq!(
            BudgetRequest::default().resolve(Watts(2.0), Watts(7.0)),
            ResolvedBudget::default()
        );
    }

    #[test]
    fn a_budget_is_kept_up_to_its_limit_and_never_by_nan() {
        let budget =
            ResolvedBudget { power_w: Some(Watts(3.0)), error: Some(0.1), ..Default::default() };
        assert!(budget.keeps(Watts(3.0), 0.1));
        assert!(!budget.keeps(Watts(3.0001), 0.1) && !budget.keeps(Watts(3.0), 0.1001));
        assert!(!budget.keeps(Watts(f64::NAN), 0.0) && !budget.keeps(Watts(0.0), f64::NAN));
        assert!(ResolvedBudget::default().keeps(Watts(f64::NAN), f64::NAN));
    }

    #[test]
    fn requests_print_as_they_are_typed() {
        let request = BudgetRequest {
            power: Some("60%".parse().unwrap()),
            error: Some(0.02),
            ..Default::default()
        };
        assert_eq!(request.to_string(), "power at most 60%, error at most 0.02");
        assert_eq!("57%".parse::<PowerBudget>().unwrap().to_string(), "57%");
        assert_eq!("7W".parse::<PowerBudget>().unwrap().to_string(), "7 W");
    }
}
