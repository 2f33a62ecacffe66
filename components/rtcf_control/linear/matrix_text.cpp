#include "linear/matrix_text.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <string_view>

#include <rtcf/read_number.hpp>

#include "words.hpp"

namespace rtcf_control {
namespace {

using rtcf::takeNumber;

// Relative to the largest element: symmetry of a matrix, and eigenvalues that count as 0.
constexpr double kRounding = 1e-9;

std::string named(const char* name, const std::string& error) {
    return fmt::format("{}: {}", name, error);
}

// Reads a pole such as -2+1j, -2 or 1j.
std::optional<std::complex<double>> readPole(std::string_view word) {
    const std::optional<double> first = takeNumber(word);
    if (!first) return std::nullopt;
    if (word.empty()) return *first;
    if (word == "j") return std::complex<double>(0.0, *first);
    if (word[0] != '+' && word[0] != '-') return std::nullopt;
    const std::optional<double> second = takeNumber(word);
    if (!second || word != "j") return std::nullopt;
    return std::complex<double>(*first, *second);
}

}  // namespace

std::string readMatrix(const std::string& text, Eigen::MatrixXd& matrix) {
    std::vector<std::vector<double>> rows;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line, ';');) {
        std::vector<double> row;
        if (const std::string wrong = readNumbers(line, row); !wrong.empty())
            return fmt::format("{} is not a number; write rows as in \"0 1; -4 -0.5\"", wrong);
        if (row.empty()) continue;
        if (!rows.empty() && row.size() != rows[0].size())
            return fmt::format("row {} has {} numbers, and row 1 has {}", rows.size() + 1,
                               row.size(), rows[0].size());
        rows.push_back(std::move(row));
    }
    const auto most = static_cast<std::size_t>(kMostStates);
    if (rows.size() > most || (!rows.empty() && rows[0].size() > most))
        return fmt::format("{} x {} is larger than {} x {}", rows.size(), rows[0].size(), most,
                           most);
    matrix.resize(static_cast<Eigen::Index>(rows.size()),
                  rows.empty() ? 0 : static_cast<Eigen::Index>(rows[0].size()));
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
        for (Eigen::Index j = 0; j < matrix.cols(); ++j)
            matrix(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    }
    return {};
}

std::string readSystem(const SystemText& text, Eigen::MatrixXd& a, Eigen::MatrixXd& b,
                       Eigen::MatrixXd& c, Eigen::MatrixXd& d) {
    const auto read = [](const char* name, const std::string& given, Eigen::MatrixXd& matrix) {
        const std::string error = readMatrix(given, matrix);
        return error.empty() ? error : named(name, error);
    };
    if (std::string error = read("A", text.a, a); !error.empty()) return error;
    if (std::string error = read("B", text.b, b); !error.empty()) return error;
    if (std::string error = read("C", text.c, c); !error.empty()) return error;
    if (std::string error = read("D", text.d, d); !error.empty()) return error;
    if (a.rows() != a.cols())
        return fmt::format("A is {} x {}, and not square", a.rows(), a.cols());
    if (a.rows() == 0) {
        if (b.size() != 0 || c.size() != 0) return "A is empty, so B and C must be empty, too";
        if (d.size() == 0) return "A and D are empty: there is nothing to compute";
        b.resize(0, d.cols());
        c.resize(d.rows(), 0);
        return {};
    }
    if (b.size() == 0) b = Eigen::MatrixXd::Zero(a.rows(), d.cols());
    if (b.rows() != a.rows()) return fmt::format("B has {} rows, and A has {}", b.rows(), a.rows());
    if (c.size() == 0) c = Eigen::MatrixXd::Identity(a.rows(), a.rows());
    if (c.cols() != a.cols())
        return fmt::format("C has {} columns, and A has {}", c.cols(), a.cols());
    if (d.size() == 0) d = Eigen::MatrixXd::Zero(c.rows(), b.cols());
    if (d.rows() != c.rows() || d.cols() != b.cols())
        return fmt::format("D is {} x {}; C and B need {} x {}", d.rows(), d.cols(), c.rows(),
                           b.cols());
    return {};
}

std::string readWeight(const char* name, const std::string& text, int size, bool definite,
                       Eigen::MatrixXd& matrix) {
    Eigen::MatrixXd given;
    if (const std::string error = readMatrix(text, given); !error.empty())
        return named(name, error);
    if (given.rows() == size && given.cols() == size) {
        matrix = given;
    } else if (given.rows() == 1 && given.cols() == size) {
        matrix = given.row(0).asDiagonal();
    } else if (given.size() == 1) {
        matrix = given(0, 0) * Eigen::MatrixXd::Identity(size, size);
    } else {
        return fmt::format("{}: {} x {} numbers; write 1, {} or {} x {}", name, given.rows(),
                           given.cols(), size, size, size);
    }
    if (size == 0) return {};
    const double scale = matrix.cwiseAbs().maxCoeff();
    if ((matrix - matrix.transpose()).cwiseAbs().maxCoeff() > kRounding * scale)
        return named(name, "the matrix is not symmetric");
    matrix = (0.5 * (matrix + matrix.transpose())).eval();
    const double lowest =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly)
            .eigenvalues()
            .minCoeff();
    if (definite && lowest <= 0.0)
        return fmt::format("{}: the eigenvalue {:.6g} is not above 0", name, lowest);
    if (lowest < -kRounding * scale)
        return fmt::format("{}: the eigenvalue {:.6g} is below 0", name, lowest);
    return {};
}

std::string readVector(const char* name, const std::string& text, int size,
                       Eigen::VectorXd& vector) {
    std::vector<double> numbers;
    if (const std::string wrong = readNumbers(text, numbers); !wrong.empty())
        return fmt::format("{}: {} is not a number", name, wrong);
    const auto count = static_cast<std::size_t>(size);
    if (numbers.size() != 1 && numbers.size() != count)
        return fmt::format("{}: {} numbers; write {}, or one for all", name, numbers.size(), size);
    vector.resize(size);
    for (Eigen::Index i = 0; i < size; ++i)
        vector[i] = numbers[numbers.size() == 1 ? 0 : static_cast<std::size_t>(i)];
    return {};
}

std::string readPoles(const std::string& text, std::vector<std::complex<double>>& poles) {
    for (const std::string& word : words(text)) {
        const std::optional<std::complex<double>> pole = readPole(word);
        if (!pole || !std::isfinite(std::abs(*pole)))
            return fmt::format("{} is not a number; write poles as in \"-3 -2+1j -2-1j\"", word);
        poles.push_back(*pole);
    }
    for (const std::complex<double>& pole : poles) {
        if (std::count(poles.begin(), poles.end(), pole) !=
            std::count(poles.begin(), poles.end(), std::conj(pole)))
            return fmt::format("{}{:+}j has no conjugate {}{:+}j", pole.real(), pole.imag(),
                               pole.real(), -pole.imag());
    }
    return {};
}

std::string complexText(const std::complex<double>& z) {
    return z.imag() == 0.0 ? fmt::format("{:.6g}", z.real())
                           : fmt::format("{:.6g}{:+.6g}j", z.real(), z.imag());
}

}  // namespace rtcf_control
