#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>

namespace fastcycle::dds_security {

template <auto kFree>
struct Free {
  template <typename T>
  void operator()(T* object) const {
    kFree(object);
  }
};
using Bio = std::unique_ptr<BIO, Free<&BIO_free_all>>;
using Key = std::unique_ptr<EVP_PKEY, Free<&EVP_PKEY_free>>;
using X509Ptr = std::unique_ptr<X509, Free<&X509_free>>;
using Pkcs7 = std::unique_ptr<PKCS7, Free<&PKCS7_free>>;

/// Borrows `text`.
[[nodiscard]] inline Bio read_from(std::string_view text) {
  return Bio(::BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

[[nodiscard]] inline std::string text_of(BIO& memory) {
  char* begin = nullptr;
  const long size = BIO_get_mem_data(&memory, &begin);
  return size <= 0 ? std::string() : std::string(begin, static_cast<std::size_t>(size));
}

/// Null if there is none in `pem`.
[[nodiscard]] inline X509Ptr certificate_of(std::string_view pem) {
  const Bio memory = read_from(pem);
  return X509Ptr(::PEM_read_bio_X509(memory.get(), nullptr, nullptr, nullptr));
}

/// Null if there is none in `pem`, or it needs a password.
[[nodiscard]] inline Key key_of(std::string_view pem) {
  const Bio memory = read_from(pem);
  const auto no_password = [](char* /*to*/, int /*size*/, int /*is_write*/, void* /*data*/) {
    return -1;
  };
  return Key(::PEM_read_bio_PrivateKey(memory.get(), nullptr, no_password, nullptr));
}

}  // namespace fastcycle::dds_security
