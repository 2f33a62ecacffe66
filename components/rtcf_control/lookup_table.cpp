#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <rtcf/component.hpp>

#include "words.hpp"

namespace rtcf_control {
namespace {

bool rises(const std::vector<double>& points) {
    return std::adjacent_find(points.begin(), points.end(),
                              [](double a, double b) { return a >= b; }) == points.end();
}

// Place of x among rising points: the cell's index and the share of its end, from 0 to 1; the share
// is outside this range beyond the ends if `beyond`.
struct Place {
    std::size_t cell;
    double share;
};

Place placeOf(const std::vector<double>& points, double x, bool beyond) {
    if (points.size() == 1) return {0, 0.0};
    const auto above = std::upper_bound(points.begin() + 1, points.end() - 1, x);
    const auto cell = static_cast<std::size_t>(above - points.begin()) - 1;
    const double share = (x - points[cell]) / (points[cell + 1] - points[cell]);
    return {cell, beyond ? share : std::clamp(share, 0.0, 1.0)};
}

double between(double a, double b, double share) {
    // Exact at both ends.
    return (1.0 - share) * a + share * b;
}

enum class Outside { Clamp, Extend };

class LookupTable final : public rtcf::Component {
    struct Table {
        std::vector<double> x;
        std::vector<double> y;
    };

    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<std::string> x{this, "x", "0 1", rtcf::Doc("inputs of the table, rising")};
    rtcf::Parameter<std::string> y{this, "y", "0 1", rtcf::Doc("outputs of the table")};
    rtcf::Parameter<Outside> outside{
        this,
        "outside",
        Outside::Clamp,
        rtcf::Choice("clamp", Outside::Clamp),
        rtcf::Choice("extend", Outside::Extend),
        rtcf::Doc("beyond the table: its last value, or the line of its last two points")};
    rtcf::Derived<Table> table_{this};

    bool prepare(const rtcf::Values& proposed) override {
        Table table;
        if (const std::string wrong = readNumbers(proposed[x], table.x); !wrong.empty())
            return RTCF_FAIL(this, "x: {} is not a number; write a list as in \"0 1 2\"", wrong);
        if (const std::string wrong = readNumbers(proposed[y], table.y); !wrong.empty())
            return RTCF_FAIL(this, "y: {} is not a number; write a list as in \"0 1 4\"", wrong);
        if (table.x.empty() || table.x.size() != table.y.size())
            return RTCF_FAIL(this, "x has {} numbers and y has {}: each point needs one of both",
                             table.x.size(), table.y.size());
        if (!rises(table.x)) return fail("x: each number must be above the previous one");
        table_.stage(std::move(table));
        return true;
    }

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        if (!std::isfinite(in.value())) {
            out.write(in.value());  // rejected as not finite: readers keep the last output
            return;
        }
        const auto& points = table_->y;
        const Place at = placeOf(table_->x, in.value(), outside == Outside::Extend);
        out.write(points.size() == 1 ? points[0]
                                     : between(points[at.cell], points[at.cell + 1], at.share));
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

class LookupTable2D final : public rtcf::Component {
    struct Table {
        std::vector<double> x;
        std::vector<double> y;
        std::vector<double> z;  // a row for each y
    };

    rtcf::Input<double> in_x{this, "x"};
    rtcf::Input<double> in_y{this, "y"};
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};

    rtcf::Parameter<std::string> columns{this, "columns", "0 1", rtcf::Doc("values of x, rising")};
    rtcf::Parameter<std::string> rows{this, "rows", "0 1", rtcf::Doc("values of y, rising")};
    rtcf::Parameter<std::string> values{this, "values", "0 0 0 0",
                                        rtcf::Doc("outputs, row by row: one for each column")};
    rtcf::Parameter<Outside> outside{
        this,
        "outside",
        Outside::Clamp,
        rtcf::Choice("clamp", Outside::Clamp),
        rtcf::Choice("extend", Outside::Extend),
        rtcf::Doc("beyond the table: its edge, or the surface of its last cell")};
    rtcf::Derived<Table> table_{this};

    bool prepare(const rtcf::Values& proposed) override {
        Table table;
        if (const std::string wrong = readNumbers(proposed[columns], table.x); !wrong.empty())
            return RTCF_FAIL(this, "columns: {} is not a number", wrong);
        if (const std::string wrong = readNumbers(proposed[rows], table.y); !wrong.empty())
            return RTCF_FAIL(this, "rows: {} is not a number", wrong);
        if (const std::string wrong = readNumbers(proposed[values], table.z); !wrong.empty())
            return RTCF_FAIL(this, "values: {} is not a number", wrong);
        if (table.x.size() < 2 || table.y.size() < 2)
            return fail("columns and rows need at least two numbers each");
        if (table.z.size() != table.x.size() * table.y.size())
            return RTCF_FAIL(this, "values has {} numbers; {} rows of {} columns need {}",
                             table.z.size(), table.y.size(), table.x.size(),
                             table.x.size() * table.y.size());
        if (!rises(table.x)) return fail("columns: each number must be above the previous one");
        if (!rises(table.y)) return fail("rows: each number must be above the previous one");
        table_.stage(std::move(table));
        return true;
    }

    void update() override {
        const bool has_x = in_x.read() != rtcf::DataStatus::None;
        const bool has_y = in_y.read() != rtcf::DataStatus::None;
        if (!has_x || !has_y) return;
        if (!std::isfinite(in_x.value()) || !std::isfinite(in_y.value())) {
            out.write(in_x.value() + in_y.value());  // rejected as not finite
            return;
        }
        const Table& table = *table_;
        const bool beyond = outside == Outside::Extend;
        const Place across = placeOf(table.x, in_x.value(), beyond);
        const Place down = placeOf(table.y, in_y.value(), beyond);
        const double* first = &table.z[down.cell * table.x.size() + across.cell];
        const double* second = first + table.x.size();
        out.write(between(between(first[0], first[1], across.share),
                          between(second[0], second[1], across.share), down.share));
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::LookupTable, "LookupTable",
                     "Function of one variable from a table, linear between its points",
                     LookupTable)
RTCF_COMPONENT_NAMED(rtcf_control::LookupTable2D, "LookupTable2D",
                     "Function of two variables from a table, bilinear between its points",
                     LookupTable2D)
