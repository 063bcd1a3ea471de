//! Non-negative least squares.

/// Sweeps of coordinate descent: a few dozen kinds of work converge far sooner.
const SWEEPS: usize = 3000;
/// Ridge penalty relative to each column's own norm, so that collinear columns share the price.
const RIDGE: f64 = 1e-4;

/// The β ≥ 0 that minimises Σ (y − xβ)², one row of `rows` per reading, by cyclic coordinate
/// descent on the normal equations (Franc, Hlaváč, Navara 2005). Columns of zeros get 0.
pub(super) fn nonnegative_least_squares(rows: &[Vec<f64>], readings: &[f64]) -> Vec<f64> {
    let count = rows.first().map_or(0, Vec::len);
    // Columns of unit norm, so that pixels and frames weigh alike.
    let length =
        |column: usize| rows.iter().map(|row| row[column] * row[column]).sum::<f64>().sqrt();
    let lengths: Vec<f64> = (0..count).map(length).collect();
    let scaled = |row: &Vec<f64>, column: usize| {
        if lengths[column] > 0.0 { row[column] / lengths[column] } else { 0.0 }
    };
    let mut gram = vec![vec![0.0; count]; count];
    let mut moments = vec![0.0; count];
    for (row, reading) in rows.iter().zip(readings) {
        let row: Vec<f64> = (0..count).map(|column| scaled(row, column)).collect();
        for a in 0..count {
            moments[a] += row[a] * reading;
            for b in 0..count {
                gram[a][b] += row[a] * row[b];
            }
        }
    }
    let mut solution = vec![0.0; count];
    for _ in 0..SWEEPS {
        let mut moved = 0.0_f64;
        for a in 0..count {
            let own = gram[a][a] + RIDGE;
            if lengths[a] == 0.0 {
                continue;
            }
            let rest: f64 = (0..count).filter(|b| *b != a).map(|b| gram[a][b] * solution[b]).sum();
            let next = ((moments[a] - rest) / own).max(0.0);
            moved = moved.max((next - solution[a]).abs());
            solution[a] = next;
        }
        if moved < 1e-12 {
            break;
        }
    }
    solution
        .iter()
        .zip(&lengths)
        .map(|(value, length)| if *length > 0.0 { value / length } else { 0.0 })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prices_are_found_and_none_is_negative() {
        let row = |i: usize| vec![1.0, (i % 7) as f64 * 1e4, (i % 3) as f64, (i * i % 11) as f64];
        let rows: Vec<_> = (0..60).map(row).collect();
        let exact = [2.0, 3e-4, 0.5, 0.0];
        let readings: Vec<f64> = rows
            .iter()
            .map(|row| row.iter().zip(&exact).map(|(x, price)| x * price).sum())
            .collect();
        let found = nonnegative_least_squares(&rows, &readings);
        for (found, exact) in found.iter().zip(&exact) {
            assert!((found - exact).abs() <= 0.01 * exact.max(0.1), "{found} for {exact}");
        }
        // A column that would need a negative price gets none.
        let falling: Vec<f64> = rows.iter().map(|row| 10.0 - row[2]).collect();
        assert!(nonnegative_least_squares(&rows, &falling).iter().all(|price| *price >= 0.0));
        assert!(nonnegative_least_squares(&[], &[]).is_empty());
        assert_eq!(nonnegative_least_squares(&[vec![0.0, 1.0]], &[3.0])[0], 0.0);
    }
}
