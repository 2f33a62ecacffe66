/// @file
/// Matrices as text: rows separated by ";" and numbers by spaces or commas, "0 1; -4 -0.5". Not
/// real-time.
#pragma once

#include <Eigen/Core>

#include <complex>
#include <string>
#include <vector>

namespace rtcf_control {

/// Most rows or columns of a matrix.
constexpr int kMostStates = 12;

/// Reads a matrix of any size; an empty text is a matrix without rows.
/// @return empty, or the error
std::string readMatrix(const std::string& text, Eigen::MatrixXd& matrix);

/// The matrices of a linear system as text.
struct SystemText {
    const std::string& a;
    const std::string& b;  ///< empty = no inputs, or 0 if there is a `d`
    const std::string& c;  ///< empty = all states
    const std::string& d;  ///< empty = 0
};

/// Reads a linear system, which may have no states.
/// @return empty, or the error, which begins with the name of the matrix
std::string readSystem(const SystemText& text, Eigen::MatrixXd& a, Eigen::MatrixXd& b,
                       Eigen::MatrixXd& c, Eigen::MatrixXd& d);

/// Reads a symmetric matrix of `size` rows without negative eigenvalues: in full, or its diagonal
/// as one row, or one number for all elements of the diagonal.
/// @param name of the parameter, with which an error begins
/// @param definite true = eigenvalues of 0 are errors, too
/// @return empty, or the error
std::string readWeight(const char* name, const std::string& text, int size, bool definite,
                       Eigen::MatrixXd& matrix);

/// Reads `size` numbers, or one number for all of them.
/// @param name of the parameter, with which an error begins
/// @return empty, or the error
std::string readVector(const char* name, const std::string& text, int size,
                       Eigen::VectorXd& vector);

/// Reads complex numbers such as "-3 -2+1j -2-1j"; they must be pairs of conjugates.
/// @return empty, or the error
std::string readPoles(const std::string& text, std::vector<std::complex<double>>& poles);

/// A number as in messages, such as "-2" or "-2+1j".
std::string complexText(const std::complex<double>& z);

}  // namespace rtcf_control
