//! Symmetric positive definite matrices of at most some hundred rows: no reason for a library.

/// Sum of products.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// L with L Lᵀ = A, by rows up to the diagonal, from the lower triangle of a symmetric positive
/// definite A (Cholesky); `None` for others.
pub(crate) fn cholesky(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let mut factor: Vec<Vec<f64>> = Vec::with_capacity(matrix.len());
    for (row, values) in matrix.iter().enumerate() {
        let mut next: Vec<f64> = Vec::with_capacity(row + 1);
        for (column, above) in factor.iter().enumerate() {
            let rest = values[column] - dot(&next, &above[..column]);
            next.push(rest / above[column]);
        }
        let rest = values[row] - dot(&next, &next);
        if rest.is_nan() || rest <= 0.0 {
            return None;
        }
        next.push(rest.sqrt());
        factor.push(next);
    }
    Some(factor)
}

/// Solves L x = y.
pub(crate) fn forward(factor: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let mut solution: Vec<f64> = Vec::with_capacity(right.len());
    for (row, y) in factor.iter().zip(right) {
        let done = dot(row, &solution);
        solution.push((y - done) / row[solution.len()]);
    }
    solution
}

/// Solves L Lᵀ x = y.
pub(crate) fn solve(factor: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let mut solution = forward(factor, right);
    for a in (0..solution.len()).rev() {
        let done: f64 = (a + 1..solution.len()).map(|b| factor[b][a] * solution[b]).sum();
        solution[a] = (solution[a] - done) / factor[a][a];
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_factored_and_solved() {
        let matrix = vec![vec![4.0, 1.0, 0.5], vec![1.0, 3.0, -0.2], vec![0.5, -0.2, 2.0]];
        let factor = cholesky(&matrix).expect("positive definite");
        let right = [1.0, -2.0, 0.5];
        let solution = solve(&factor, &right);
        for (a, row) in matrix.iter().enumerate() {
            assert!((dot(row, &solution) - right[a]).abs() < 1e-12);
        }
    }

    #[test]
    fn other_matrices_have_no_factor() {
        assert_eq!(cholesky(&[vec![1.0], vec![2.0, 1.0]]), None, "indefinite");
        assert_eq!(cholesky(&[vec![f64::NAN]]), None);
        assert_eq!(cholesky(&[]), Some(Vec::new()));
    }
}
