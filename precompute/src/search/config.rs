//! How long and how hard a search looks.

/// Combinations above which a space counts as large: Wang et al. 2016 give theirs of 16,384 more
/// generations than theirs of 300.
const LARGE: u64 = 10_000;

/// Settings of the genetic search.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchConfig {
    /// Settings that survive a generation, at least 4. Higher values keep more of the frontier in
    /// play, lower values converge in fewer evaluations.
    pub population: usize,
    /// Generations of `population` evaluations after the first; by default 25, and 40 in a space of
    /// more than 10,000 combinations (Wang et al. 2016). Together they bound the evaluations at
    /// population × (generations + 1).
    pub generations: Option<usize>,
    /// Probability, 0 to 1, that a knob of an offspring changes; by default one knob per offspring
    /// on average (Deb et al. 2002, 1/n).
    pub mutation_probability: Option<f64>,
    /// Most evaluations; at least the highest and the lowest settings are always evaluated. `None`:
    /// the generations decide.
    pub max_evaluations: Option<usize>,
    /// Seeds every random choice. The same seed gives the same frontiers wherever costs are
    /// reproducible.
    pub seed: u64,
}

impl Default for SearchConfig {
    fn default() -> Self {
        Self {
            population: 24,
            generations: None,
            mutation_probability: None,
            max_evaluations: None,
            seed: 0,
        }
    }
}

impl SearchConfig {
    /// Most evaluations of a search in a space of `combinations`, before any other limit.
    pub fn evaluations(&self, combinations: u64) -> usize {
        let generations = self.generations.unwrap_or(if combinations > LARGE { 40 } else { 25 });
        self.population.max(4).saturating_mul(generations.saturating_add(1))
    }
}
