#pragma once
// Draws the figures of a diagnosis; all without provenance. There is none where there is nothing to draw.

#include <vector>

#include "analysis/diagnosis/diagnosis.h"
#include "reports/output/figure.h"

namespace metastable::reports {

/// Draws the places of the map whose scores under any of the three models are beyond chance, eight at most: of the mean
/// speed, and of its spread where there are such. Where there are none, the three furthest of the mean.
std::vector<Figure> furthest_figures(const analysis::Diagnosis& diagnosis);
/// Draws all the map's cells under the three models, coloured by their scores, some facets a figure, collisions and
/// stances apart.
std::vector<Figure> map_figures(const analysis::Diagnosis& diagnosis);
/// Draws bars of the share of the held-out gap that each effect at work closes, alone and last.
std::vector<Figure> closes_figures(const analysis::Diagnosis& diagnosis);
/// Draws each column's next value against the one before, measured and simulated by the model as given; of machines,
/// where the answer has its model.
std::vector<Figure> return_map_figures(const analysis::Diagnosis& diagnosis);
/// Draws the mean speed by collision, measured and simulated, a figure a condition.
std::vector<Figure> profile_figures(const analysis::Diagnosis& diagnosis);
/// Draws the causes by probability.
std::vector<Figure> ranking_figures(const analysis::Diagnosis& diagnosis);
/// Draws bars of each held-out measure, its floor as a line.
std::vector<Figure> shrinkage_figures(const analysis::Diagnosis& diagnosis);

}  // namespace metastable::reports
