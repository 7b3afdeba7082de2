#include "markov/mesh/score_curve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

namespace metastable::markov {
namespace {

// Gaps in which failures begin, or the curve bends, are halved down to this share of the spacing; down to the second
// one where what happens there is rare.
constexpr double narrowest_gap_share = 1.0 / 512, widest_gap_share = 0.5;
constexpr std::size_t most_places = 6;  // that a polynomial goes through
constexpr double foretold = 2e-3;       // stationary sds: what a gap's middle may lie off before it was stepped;
                                        // afterwards a sixty-fourth is left
constexpr double extrapolated = 10;     // times that, where a polynomial had to look beyond its places
constexpr int foreseen = 2;             // further halvings of a gap that a dear map is asked for ahead
// Pairs of Gauss's points a cell of the lattice, by dimension: the intervals of one and two dimensions are narrow
// enough to show what fewer leave.
constexpr std::array<double, 4> per_cell{2, 2, 1.5, 1.5};
// Between two places there are at most so many pairs.
constexpr double pair_limit = 1024;

using Point = NodeLattice::Point;

/// Returns the probability that a normal score lies in (low, high), with relative accuracy in both tails.
double normal_mass(double low, double high) {
  const auto tail = [](double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); };
  return low > 0 ? tail(low) - tail(high) : tail(-high) - tail(-low);
}

/// The polynomial through up to most_places places, in Newton's form.
class PlacePolynomial {
 public:
  template <class Places>
  explicit PlacePolynomial(const Places& places) : count_(places.size()) {
    for (std::size_t i = 0; i < count_; ++i) {
      score_[i] = places[i].score;
      by_[i] = places[i].landing.at;
    }
    for (std::size_t order = 1; order < count_; ++order)
      for (std::size_t i = count_ - 1; i >= order; --i)
        for (std::size_t k = 0; k < by_[i].size(); ++k)
          by_[i][k] = (by_[i][k] - by_[i - 1][k]) / (score_[i] - score_[i - order]);
  }
  Point operator()(double score) const {
    Point at = by_[count_ - 1];
    for (std::size_t i = count_ - 1; i-- > 0;)
      for (std::size_t k = 0; k < at.size(); ++k) at[k] = at[k] * (score - score_[i]) + by_[i][k];
    return at;
  }

 private:
  std::size_t count_;
  std::array<double, most_places> score_{};
  std::array<Point, most_places> by_{};
};

double distance(const Point& a, const Point& b) {
  double squared = 0;
  for (std::size_t k = 0; k < a.size(); ++k) squared += (a[k] - b[k]) * (a[k] - b[k]);
  return std::sqrt(squared);
}

/// Shares landings among the corners of their cells; those that follow one another in one cell are added up first.
class Sharing {
 public:
  Sharing(const NodeLattice& lattice, int phase, double weight, std::vector<std::pair<std::uint64_t, double>>& parts)
      : lattice_(lattice), phase_(phase), weight_(weight), dimension_(lattice.dimension()), parts_(parts) {}
  ~Sharing() { flush(); }
  double pairs_per_cell() const { return per_cell[dimension_ - 1]; }
  Sharing(const Sharing&) = delete;
  Sharing& operator=(const Sharing&) = delete;

  void add(const Point& at, double weight) {
    Point fraction{};
    const std::uint64_t cell = lattice_.find_cell(phase_, at, fraction);
    if (cell != cell_) {
      flush();
      cell_ = cell;
    }
    switch (dimension_) {
      case 1:
        return share_out<1>(fraction, weight * weight_);
      case 2:
        return share_out<2>(fraction, weight * weight_);
      case 3:
        return share_out<3>(fraction, weight * weight_);
      default:
        return share_out<4>(fraction, weight * weight_);
    }
  }

 private:
  template <std::size_t dimension>
  void share_out(const Point& fraction, double weight) {
    std::array<double, std::size_t{1} << dimension> share{weight};
    for (std::size_t k = 0, corners = 1; k < dimension; ++k, corners *= 2)
      for (std::size_t c = 0; c < corners; ++c) {
        share[c + corners] = share[c] * fraction[k];
        share[c] -= share[c + corners];
      }
    for (std::size_t c = 0; c < share.size(); ++c) sum_[c] += share[c];
  }

  void flush() {
    for (std::size_t c = 0; c < std::size_t{1} << dimension_; ++c) {
      if (!(sum_[c] > 0)) continue;
      std::uint64_t key = cell_;
      for (std::size_t k = 0; k < dimension_; ++k)
        if ((c >> k) & 1U) key += NodeLattice::axis_key(k);
      parts_.emplace_back(key, sum_[c]);
    }
    sum_ = {};
  }

  const NodeLattice& lattice_;
  int phase_;
  double weight_;
  std::size_t dimension_;
  std::vector<std::pair<std::uint64_t, double>>& parts_;
  std::uint64_t cell_ = 0;
  std::array<double, 16> sum_{};
};

/// Shares the mass between two scores along a curve that goes through about so many cells.
void share_along(const PlacePolynomial& curve, double low, double high, double cells, Sharing& sharing) {
  const double mass = normal_mass(low, high);
  if (!(mass > 0)) return;
  const double pairs = std::clamp(std::ceil(cells * sharing.pairs_per_cell()), 1.0, pair_limit),
               width = (high - low) / pairs;
  const double aside = 0.5 / std::numbers::sqrt3;  // Gauss's two points of (-1/2, 1/2)
  std::array<double, 2 * static_cast<std::size_t>(pair_limit)> density;
  double sum = 0;
  std::size_t count = 0;
  const auto each = [&](const auto& use) {
    for (double i = 0.5; i < pairs; i += 1)
      for (const double part : {i - aside, i + aside}) use(low + width * part);
  };
  each([&](double z) { sum += density[count++] = std::exp(0.5 * (low * low - z * z)); });
  count = 0;
  each([&](double z) { sharing.add(curve(z), mass * density[count++] / sum); });
}

}  // namespace

ScoreCurve::ScoreCurve(double spacing, double reach, double beyond) : spacing_(spacing), beyond_(beyond) {
  // The first places stand twice as far apart: what lies between them shows how far the curve can be trusted.
  const double gaps = std::max(2.0, std::ceil(reach / spacing));
  for (double i = 0; i <= gaps; i += 1) asked_.push_back(reach * (2 * i / gaps - 1));
}

/// Returns the width of a gap that is not halved any more.
double ScoreCurve::narrowest_gap(double score) const {
  // The error of a share grows with the square of the width, and the share counts by exp(-rarer).
  const double rarer = std::max(0.0, beyond_ + 0.5 * score * score);
  return spacing_ * std::min(widest_gap_share, narrowest_gap_share * std::exp(0.5 * rarer));
}

bool ScoreCurve::joined(std::size_t left) const {
  return place_[left].landing.fate == Fate::lands && place_[left + 1].landing.fate == Fate::lands && !place_[left].torn;
}

/// Returns the nearest places, most_places at most, on the piece of the curve that holds the places left .. right.
std::span<const ScoreCurve::Place> ScoreCurve::stencil(std::size_t left, std::size_t right) const {
  std::size_t first = left, last = right;
  while (last - first + 1 < most_places) {
    const bool before = first > 0 && joined(first - 1), after = last + 1 < place_.size() && joined(last);
    if (!before && !after) break;
    if (!after || (before && left - first <= last - right))
      --first;
    else
      ++last;
  }
  return std::span(place_).subspan(first, last - first + 1);
}

/// Decides which halves of the gap after place `at` are to be halved again.
void ScoreCurve::halve(Place& left, Place& middle, const Place& right, std::size_t at, double unit) const {
  const bool more = middle.score - left.score > narrowest_gap(middle.score);
  const auto lands = [](const Place& place) { return place.landing.fate == Fate::lands; };
  const auto off = [&](std::size_t from, std::size_t to) {
    return unit * distance(PlacePolynomial(stencil(from, to))(middle.score), middle.landing.at);
  };
  const bool l = lands(left), m = lands(middle), r = lands(right);
  left.open = more && left.landing.fate != middle.landing.fate;
  middle.open = more && middle.landing.fate != right.landing.fate;
  if (!m) return;
  if (l && r) {
    const bool rough = off(at, at + 1) > foretold;
    left.open = middle.open = rough && more;
    left.torn = middle.torn = rough && !more;
  } else if (l) {
    left.open = more && off(at, at) > extrapolated * foretold;
  } else if (r) {
    middle.open = more && off(at + 1, at + 1) > extrapolated * foretold;
  }
}

void ScoreCurve::answer(std::span<const Landing> landings, double unit) {
  std::vector<Place> next;
  if (place_.empty()) {
    for (std::size_t i = 0; i < landings.size(); ++i)
      next.push_back({asked_[i], landings[i], i + 1 < landings.size(), false});
  } else {
    std::size_t answered = 0;
    for (std::size_t i = 0; i < place_.size(); ++i) {
      next.push_back(place_[i]);
      if (!place_[i].open) continue;
      Place middle{asked_[answered], landings[answered], false, false};
      ++answered;
      halve(next.back(), middle, place_[i + 1], i, unit);
      next.push_back(middle);
    }
  }
  place_ = std::move(next);
  asked_.clear();
  for (std::size_t i = 0; i < place_.size(); ++i)
    if (place_[i].open) asked_.push_back(0.5 * (place_[i].score + place_[i + 1].score));
}

std::optional<ScoreCurve::Fate> ScoreCurve::fate(double score) const {
  const auto right = std::upper_bound(place_.begin(), place_.end(), score,
                                      [](double z, const Place& place) { return z < place.score; });
  if (right == place_.begin() || right == place_.end()) return std::nullopt;
  const Fate before = (right - 1)->landing.fate;
  return before == right->landing.fate ? std::optional(before) : std::nullopt;
}

ScoreCurve::Shares ScoreCurve::share(const NodeLattice& lattice, int phase, double weight,
                                     std::vector<std::pair<std::uint64_t, double>>& parts) const {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Shares shares;
  Sharing sharing(lattice, phase, weight, parts);
  const auto give = [&](const Landing& landing, double mass) {
    if (landing.fate == Fate::lands)
      sharing.add(landing.at, mass);
    else
      (landing.fate == Fate::fails ? shares.fails : shares.leaves) += mass;
  };
  const auto beyond = [&](const Place& last) {
    (last.landing.fate == Fate::fails ? shares.fails : shares.leaves) += normal_mass(std::abs(last.score), infinity);
  };
  beyond(place_.front());
  for (std::size_t i = 0; i + 1 < place_.size(); ++i) {
    const Place &left = place_[i], &right = place_[i + 1];
    if (joined(i)) {
      share_along(PlacePolynomial(stencil(i, i + 1)), left.score, right.score,
                  distance(left.landing.at, right.landing.at), sharing);
    } else {
      const double between = 0.5 * (left.score + right.score);
      give(left.landing, normal_mass(left.score, between));
      give(right.landing, normal_mass(between, right.score));
    }
  }
  beyond(place_.back());
  return shares;
}

std::vector<double> ScoreCurve::may_ask(int halvings) const {
  std::vector<double> scores;
  const auto halves = [&](const auto& again, double low, double high, int left) -> void {
    if (left == 0) return;
    const double middle = 0.5 * (low + high);
    for (const auto& [from, to] : {std::pair(low, middle), std::pair(middle, high)}) {
      scores.push_back(0.5 * (from + to));
      again(again, from, to, left - 1);
    }
  };
  if (place_.empty())
    for (std::size_t i = 0; i + 1 < asked_.size(); ++i) scores.push_back(0.5 * (asked_[i] + asked_[i + 1]));
  for (std::size_t i = 0; i < place_.size(); ++i)
    if (place_[i].open) halves(halves, place_[i].score, place_[i + 1].score, halvings);
  return scores;
}

namespace {

/// Follows curves of one phase round by round.
class Following {
 public:
  Following(const BatchMap& map, const NodeLattice& lattice, int phase, const ScoreLines& lines, double unit)
      : map_(map),
        lattice_(lattice),
        phase_(phase),
        lines_(lines),
        unit_(unit),
        d_(static_cast<std::size_t>(map.dimension)),
        fixed_(static_cast<std::size_t>(map.scores) - 1) {}

  void follow(std::vector<ScoreCurve>& curves) {
    for (;;) {
      clear();
      for (std::size_t n = 0; n < curves.size(); ++n)
        for (const double score : curves[n].asked()) add(n, score);
      if (scores_.empty()) return;
      checked_step(map_, phase_, from_, scores_, next_, failed_);
      std::size_t first = 0;
      for (ScoreCurve& curve : curves) {
        std::vector<ScoreCurve::Landing> landings(curve.asked().size());
        for (ScoreCurve::Landing& landing : landings) landing = landing_of(first++);
        if (!landings.empty()) curve.answer(landings, unit_);
      }
    }
  }

  /// Does the same in fewer calls: landings of scores that a curve may ask for are known beforehand.
  void follow_ahead(std::vector<ScoreCurve>& curves) {
    std::vector<std::map<double, ScoreCurve::Landing>> known(curves.size());
    for (;;) {
      clear();
      std::vector<std::pair<std::size_t, double>> asked;  // curve and score of each row
      const auto ask = [&](std::size_t n, double score) {
        if (known[n].contains(score)) return;
        asked.emplace_back(n, score);
        add(n, score);
      };
      for (std::size_t n = 0; n < curves.size(); ++n) {
        answer_what_is_known(curves[n], known[n]);
        for (const double score : curves[n].asked()) ask(n, score);
      }
      if (asked.empty()) return;
      const std::size_t sure = asked.size();
      for (std::size_t n = 0; n < curves.size(); ++n)
        for (const double score : curves[n].may_ask(foreseen)) ask(n, score);
      for (std::size_t first = 0; first < asked.size();) {
        const std::size_t last = std::min(asked.size(), first + rows_of_a_dear_call);
        step(first, last);
        first = last;
      }
      require_landings(map_, phase_, std::span(from_).first(sure * d_), std::span(next_).first(sure * d_),
                       std::span(failed_).first(sure));
      // What was not asked for yet and leads to no number is asked for again, if ever, and then named.
      for (std::size_t i = 0; i < asked.size(); ++i)
        if (i < sure || failed_[i] ||
            is_landing(map_, (phase_ + 1) % map_.phases, std::span(next_).subspan(i * d_, d_)))
          known[asked[i].first].emplace(asked[i].second, landing_of(i));
    }
  }

 private:
  void clear() { from_.clear(), scores_.clear(), next_.clear(), failed_.clear(); }

  void add(std::size_t n, double score) {
    from_.insert(from_.end(), lines_.states.data() + n * d_, lines_.states.data() + (n + 1) * d_);
    scores_.push_back(score);
    scores_.insert(scores_.end(), lines_.others.data() + n * fixed_, lines_.others.data() + (n + 1) * fixed_);
    next_.resize(from_.size());
    failed_.push_back(0);
  }

  void step(std::size_t first, std::size_t last) {
    const std::size_t some = last - first, s = fixed_ + 1;
    map_.step(phase_, std::span(from_).subspan(first * d_, some * d_), std::span(scores_).subspan(first * s, some * s),
              std::span(next_).subspan(first * d_, some * d_), std::span(failed_).subspan(first, some));
  }

  ScoreCurve::Landing landing_of(std::size_t row) const {
    ScoreCurve::Landing landing;
    if (failed_[row])
      landing.fate = ScoreCurve::Fate::fails;
    else if (!lattice_.locate((phase_ + 1) % map_.phases, &next_[row * d_], landing.at))
      landing.fate = ScoreCurve::Fate::leaves;
    return landing;
  }

  void answer_what_is_known(ScoreCurve& curve, std::map<double, ScoreCurve::Landing>& known) const {
    while (!curve.asked().empty()) {
      std::vector<ScoreCurve::Landing> landings;
      for (const double score : curve.asked()) {
        const auto found = known.find(score);
        if (found == known.end()) return;
        landings.push_back(found->second);
      }
      curve.answer(landings, unit_);
    }
  }

  const BatchMap& map_;
  const NodeLattice& lattice_;
  int phase_;
  const ScoreLines& lines_;
  double unit_;
  std::size_t d_, fixed_;
  std::vector<double> from_, scores_, next_;
  std::vector<std::uint8_t> failed_;
};

}  // namespace

std::vector<ScoreCurve> follow_curves(const BatchMap& map, const NodeLattice& lattice, int phase,
                                      const ScoreLines& lines, double spacing, double unit) {
  std::vector<ScoreCurve> curves;
  for (std::size_t n = 0; n < lines.reach.size(); ++n)
    lines.beyond.empty() ? curves.emplace_back(spacing, lines.reach[n])
                         : curves.emplace_back(spacing, lines.reach[n], lines.beyond[n]);
  Following following(map, lattice, phase, lines, unit);
  map.dear ? following.follow_ahead(curves) : following.follow(curves);
  return curves;
}

}  // namespace metastable::markov
