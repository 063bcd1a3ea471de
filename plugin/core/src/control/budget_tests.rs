//! Tests of budgets and of transition times.

use super::*;

fn refused(budget: Budget) -> &'static str {
    budget.validate().expect_err("an invalid limit").limit
}

#[test]
fn zero_and_infinity_are_valid_limits_nan_and_negative_numbers_are_not() {
    for limit in [0.0, -0.0, 1e-300, 7.0, f64::INFINITY] {
        assert_eq!(Budget::power(Watts(limit)).validate(), Ok(()));
        assert_eq!(Budget::error(limit).validate(), Ok(()));
        assert_eq!(Budget::default().with_peak(Watts(limit)).validate(), Ok(()));
        assert_eq!(Budget::both(Watts(limit), limit).validate(), Ok(()));
    }
    for limit in [f64::NAN, -1e-300, -7.0, f64::NEG_INFINITY] {
        assert_eq!(refused(Budget::power(Watts(limit))), "power budget");
        assert_eq!(refused(Budget::error(limit)), "error budget");
        assert_eq!(refused(Budget::default().with_peak(Watts(limit))), "peak");
        assert_eq!(refused(Budget::both(Watts(1.0), limit)), "error budget");
    }
    assert_eq!(Budget::default().validate(), Ok(()));
}

#[test]
fn limits_of_other_currencies_are_checked_too() {
    let none = Budget::default();
    for energy in [0.0, 0.2, f64::INFINITY] {
        assert_eq!(none.with_energy_per_frame(Joules(energy)).validate(), Ok(()));
    }
    for odd in [f64::NAN, -0.1, f64::NEG_INFINITY] {
        assert_eq!(refused(none.with_energy_per_frame(Joules(odd))), "energy budget");
        assert_eq!(refused(none.with_headroom(odd)), "thermal headroom");
    }
    assert!(none.with_headroom(1.1).validate().is_err());
    for share in [0.0, 0.3, 1.0] {
        assert_eq!(none.with_headroom(share).validate(), Ok(()));
    }
    let all = Budget::both(Watts(7.0), 0.02)
        .with_frame_time(Duration::ZERO)
        .with_battery_until(Duration::MAX);
    assert_eq!((all.validate(), all.power, all.error), (Ok(()), Some(Watts(7.0)), Some(0.02)));
}

#[test]
fn the_message_tells_the_value_and_the_remedy() {
    let message = Budget::power(Watts(-2.0)).validate().expect_err("a negative budget").to_string();
    assert!(message.contains("-2 W") && message.contains("0 or more"), "{message}");
}
